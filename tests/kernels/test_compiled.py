"""Where compiled kernels are kept."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from gridslam.kernels import machine_code_cache, raycast
from gridslam.kernels.machine_code_cache import cache_directory, sources_of
from tests.conftest import REPOSITORY


def folder_of(module: Path) -> Path:
    cache_directory.cache_clear()
    return cache_directory(module)


def test_a_change_of_a_source_that_is_used_leads_to_another_folder(tmp_path: Path) -> None:
    constants, tables, loops = (tmp_path / f"{name}.py" for name in ("constants", "tables", "loops"))
    constants.write_text("SIZE = 16\n")
    tables.write_text("from gridslam.kernels.constants import SIZE\n")
    loops.write_text("import numpy\n\nfrom gridslam.kernels.tables import SIZE\n")
    before = folder_of(loops)
    assert folder_of(loops) == before
    constants.write_text("SIZE = 8\n")
    assert folder_of(loops) != before


def test_a_change_of_another_source_leads_to_the_same_folder(tmp_path: Path) -> None:
    (tmp_path / "loops.py").write_text("")
    before = folder_of(tmp_path / "loops.py")
    (tmp_path / "others.py").write_text("from gridslam.kernels.loops import nothing\n")
    assert folder_of(tmp_path / "loops.py") == before


def test_sources_that_import_each_other_end(tmp_path: Path) -> None:
    first, second = tmp_path / "first.py", tmp_path / "second.py"
    first.write_text("from gridslam.kernels.second import b\n")
    second.write_text("from gridslam.kernels.first import a\n")
    assert sources_of(first) == {first, second}


def test_the_folder_lies_beside_the_sources_where_that_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "loops.py").write_text("")
    assert folder_of(tmp_path / "loops.py").parent == tmp_path / "__pycache__" / "kernels"


def test_kernels_are_kept_in_the_folder_of_their_module() -> None:
    assert Path(raycast.cast._cache.cache_path) == cache_directory(Path(raycast.__file__))


def test_machine_code_is_valid_wherever_its_package_is_moved(tmp_path: Path) -> None:
    ignore = shutil.ignore_patterns("__pycache__", "methods", "simulation", "planning")
    shutil.copytree(REPOSITORY / "gridslam", tmp_path / "before" / "gridslam", ignore=ignore)
    kept = run_start(None, tmp_path / "before")
    (tmp_path / "before").rename(tmp_path / "after")
    for source in (tmp_path / "after").rglob("*.py"):
        source.touch()
    folder = Path(run_start(None, tmp_path / "after"))
    assert folder == tmp_path / "after" / Path(kept).relative_to(tmp_path / "before")
    assert len([file for file in folder.iterdir() if file.suffix == ".nbc"]) == 1
    assert all(file.stat().st_mtime_ns < source.stat().st_mtime_ns for file in folder.iterdir())


SCRIPT = """
import sys
sys.path.insert(0, {repository!r})
from pathlib import Path
from gridslam.kernels import machine_code_cache, start
start.start()
print(start._same._cache.cache_path if hasattr(start._same._cache, "cache_path") else "none")
"""


def run_start(cache: Path | None, repository: Path = REPOSITORY) -> str:
    """The folder of the smallest kernel, compiled or loaded in a process of its own; `cache` is numba's NUMBA_CACHE_DIR."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(repository=str(repository))],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache or "")},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout.strip()


@pytest.mark.parametrize("keep", [0, 10, 0.5])
def test_damaged_files_are_compiled_anew(tmp_path: Path, keep: float) -> None:
    run_start(tmp_path)
    files = [file for file in tmp_path.rglob("*") if file.suffix in (".nbi", ".nbc")]
    assert len(files) == 2
    for file in files:
        data = file.read_bytes()
        file.write_bytes(data[: int(keep * len(data)) if keep < 1 else int(keep)])
    run_start(tmp_path)
    assert all(len(file.read_bytes()) > 100 for file in files)


def test_a_folder_that_cannot_be_written_stops_nothing() -> None:
    assert "/proc" not in run_start(Path("/proc/gridslam"))


def test_read_only_sources_and_home_lead_to_a_private_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine_code_cache, "_is_writable", lambda folder: False)
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    machine_code_cache._private_temporary_folder.cache_clear()
    (tmp_path / "loops.py").write_text("")
    folder = folder_of(tmp_path / "loops.py").parent
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0
    folder.chmod(0o777)
    machine_code_cache._private_temporary_folder.cache_clear()
    assert folder_of(tmp_path / "loops.py").parent != folder
    machine_code_cache._private_temporary_folder.cache_clear()
    cache_directory.cache_clear()
