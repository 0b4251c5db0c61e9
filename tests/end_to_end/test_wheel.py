"""What is installed is what is in the tree, and it works without the checkout."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

PARTS = {"gridslam": "gridslam", "cli": "gridslam/cli", "configs": "gridslam/configs"}
SHIPPED = {".py", ".yaml", ".png", ".html", ".j2", ".typed"}


def tree_files() -> dict[str, Path]:
    """Every file of the tree that must be installed: its name in the wheel, and where it lies."""
    return {
        f"{target}/{file.relative_to(REPOSITORY / part).as_posix()}": file
        for part, target in PARTS.items()
        for file in (REPOSITORY / part).rglob("*")
        if file.is_file() and (file.suffix in SHIPPED or file.name == "py.typed")
    }


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the tree without the network."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for part in PARTS:
        shutil.copytree(REPOSITORY / part, source / part, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, source / name)
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, source]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_the_tree_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        installed = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert installed == set(tree_files())


def test_the_installed_program_finds_its_configs_and_templates(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r})\n"
        "sys.meta_path[:] = [f for f in sys.meta_path if 'Editable' not in getattr(f, '__name__', '')]\n"
        "from gridslam.cli.main import main; import gridslam, jinja2\n"
        "jinja2.PackageLoader('gridslam.report')\n"
        "print(gridslam.__file__); sys.exit(main(['config', 'check', 'slam-sd']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "site") in done.stdout
    assert "slam-sd: valid" in done.stdout
