"""Every command of the README and the pages is true, every configuration shown is valid, every link leads somewhere."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gridslam.cli.main import main
from gridslam.config.yaml_file import parse_mapping
from gridslam.methods.registry import METHODS
from gridslam.runs.run_config import validate_run_config
from tests.conftest import REPOSITORY

PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    """The page's code blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), flags=re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)", page.read_text())
    missing = [t for t in targets if "://" not in t and not (page.parent / t).exists()]
    assert missing == []


def test_every_page_is_linked_from_the_readme() -> None:
    linked = set(re.findall(r"\]\((docs/[^)#]+\.md)", PAGES[0].read_text()))
    assert linked == {f"docs/{page.name}" for page in PAGES[1:]}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_configuration_shown_is_valid(page: Path) -> None:
    for block in blocks(page, "yaml"):
        if "method:" not in block:
            continue  # the layout of a CSV folder, or part of a configuration
        config = validate_run_config(parse_mapping(block, page.name), page.name)
        assert config.method_name in METHODS


COMMAND = r"^.*<<'END'\n(?:.*\n)*?END$|^.+$"  # a line, or a file written down to END


def commands_of(page: Path) -> list[str]:
    """The commands of the page's `sh` blocks: what a reader can run as it stands, one after the other, beside sample_logs/."""
    found = [command for block in blocks(page, "sh") for command in re.findall(COMMAND, block, re.MULTILINE)]
    return [command for command in found if command.strip()]


@pytest.mark.usefixtures("sweeps_here")
@pytest.mark.parametrize("page", [p for p in PAGES if commands_of(p)], ids=lambda page: page.name)
def test_every_command_works(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("sample_logs", "configs"):
        (tmp_path / name).symlink_to(REPOSITORY / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    assert shutil.which("gridslam"), "the program is not installed in this environment"
    for command in commands_of(page):
        code = exit_code_of(command)
        shown = capfd.readouterr()
        assert code == 0, f"{command}\n{shown.out}{shown.err}"


SHELL_WORDS = {"|", ">", ">>", "<", "&&", "||", ";", "&"}


def exit_code_of(command: str) -> int:
    """Exit code of a command line: the program runs in this process, which saves its imports, all else in a shell."""
    if command.startswith("gridslam "):
        words = shlex.split(command)
        if not SHELL_WORDS & set(words):
            return main(words[1:])
    return subprocess.run(command, shell=True).returncode


def test_the_readme_shows_how_to_use_the_program() -> None:
    assert len(commands_of(PAGES[0])) >= 8
