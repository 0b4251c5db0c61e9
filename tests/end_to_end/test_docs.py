"""Every command of the README is true, every configuration shown is valid, every link leads somewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gridslam.config.yaml_file import parse_mapping
from gridslam.run_config import validate_run_config
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
        validate_run_config(parse_mapping(block, page.name), page.name)


def test_every_command_of_the_readme_works(tmp_path: Path) -> None:
    lines = [line for block in blocks(REPOSITORY / "README.md", "sh") for line in block.splitlines()]
    commands = [line for line in lines if line.strip()]
    assert len(commands) >= 8
    (tmp_path / "sample_logs").symlink_to(REPOSITORY / "sample_logs")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    assert shutil.which("gridslam", path=path), "the program is not installed in this environment"
    for command in commands:
        done = subprocess.run(
            command,
            shell=True,
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
