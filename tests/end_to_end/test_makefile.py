"""The newcomer's door: what make says before and instead of setting up."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", *arguments], cwd=folder, capture_output=True, text=True, timeout=60)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """What make needs of the checkout."""
    for name in ("Makefile", "pyproject.toml", "setup.py"):
        shutil.copy(REPOSITORY / name, tmp_path)
    return tmp_path


def interpreter(folder: Path, refuses: str) -> str:
    """A Python that fails at commands that hold a word."""
    script = folder / "python"
    script.write_text(f'#!/bin/sh\ncase "$*" in *{refuses}*) exit 1;; esac\nexec {sys.executable} "$@"\n')
    script.chmod(0o755)
    return f"PYTHON={script}"


def test_make_alone_lists_the_targets(checkout: Path) -> None:
    done = make(checkout)
    assert done.returncode == 0
    for target in ("map", "test", "lint", "bench", "papers", "newcomer", "samples", "clean"):
        assert f"make {target}" in done.stdout


@pytest.mark.parametrize(
    ("refuses", "says"),
    [("ensurepip", "apt install python3-venv"), ("version_info", "needs Python 3.10 or newer")],
)
def test_an_unfit_python_is_named_and_nothing_is_set_up(checkout: Path, refuses: str, says: str) -> None:
    done = make(checkout, "map", interpreter(checkout, refuses))
    assert done.returncode == 2
    assert says in done.stderr
    assert not (checkout / ".venv").exists()


def test_an_interrupted_set_up_starts_again(checkout: Path) -> None:
    """The first attempt leaves a broken environment and no stamp; the next one clears it."""
    (checkout / ".venv" / "bin").mkdir(parents=True)
    (checkout / ".venv" / "bin" / "python").write_text("#!/bin/sh\nexit 1\n")
    done = make(checkout, "-n", ".venv/.ready")
    assert "-m venv --clear .venv" in done.stdout


def test_a_finished_set_up_is_not_done_again(checkout: Path) -> None:
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / ".ready").touch()
    assert "venv --clear" not in make(checkout, "-n", "map").stdout


def test_a_folder_of_the_name_of_a_target_does_not_count_as_made(checkout: Path) -> None:
    targets = [line.split()[1] for line in make(checkout).stdout.splitlines() if line.startswith("make ")]
    assert "docs" in targets
    for target in targets:
        (checkout / target).mkdir()
    for target in targets:
        assert "up to date" not in make(checkout, "-n", target).stdout, target
