"""Where compiled kernels are kept."""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gridslam.kernels import machine_code_cache, start
from gridslam.kernels.grids import raycast
from gridslam.kernels.machine_code_cache import (
    DIGEST_BYTES,
    MachineCodeCache,
    cache_directory,
    folders_of,
    sources_of,
    trusted_owners,
)
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
    assert len([file for file in folder.iterdir() if file.suffix == ".code"]) == 1
    assert all(file.stat().st_mtime_ns < source.stat().st_mtime_ns for file in folder.iterdir())


SCRIPT = """
import sys
sys.path.insert(0, {repository!r})
from pathlib import Path
from gridslam.kernels import machine_code_cache, start
start.start()
print(start._same._cache.cache_path)
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


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of the smallest kernel's machine code for this CPU, the only one in a folder where its cache looks."""
    start.start()
    kernel: Any = start._same
    key = kernel._cache._key(kernel.signatures[0], kernel.targetctx.codegen())
    file = Path(kernel._cache.cache_path) / kernel._cache._name(key)
    monkeypatch.setattr(kernel._cache, "_folders", (tmp_path,))
    monkeypatch.setattr(MachineCodeCache, "complaint", None)
    return Path(shutil.copy(file, tmp_path))


def load() -> Any:
    """What the cache holds of the smallest kernel."""
    kernel: Any = start._same
    return kernel._cache.load_overload(kernel.signatures[0], kernel.targetctx)


def save() -> None:
    """Let the cache keep something as machine code of the smallest kernel."""
    kernel: Any = start._same
    code = SimpleNamespace(codegen=kernel.targetctx.codegen(), _reduce=lambda: b"code")
    kernel._cache.save_overload(kernel.signatures[0], code)


def test_damaged_files_and_those_of_other_kernels_are_not_loaded(kept: Path) -> None:
    """Machine code with a wrong bit may do anything: a file cut or changed anywhere is never run."""
    whole = kept.read_bytes()
    assert load() is not None
    changed = [whole[:k] + bytes([whole[k] ^ 1]) + whole[k + 1 :] for k in range(0, len(whole), 997)]
    body = pickle.dumps((("another",), pickle.loads(whole[DIGEST_BYTES:])[1]))
    other = hashlib.sha256(body).digest() + body
    for damaged in (
        b"",
        whole[:10],
        whole[: len(whole) // 2],
        whole[:-1],
        whole + b"x",
        b"\0" * 5000,
        other,
        *changed,
    ):
        kept.write_bytes(damaged)
        assert load() is None


def test_a_pipe_or_a_device_in_the_place_of_machine_code_is_not_read(kept: Path) -> None:
    kept.unlink()
    os.mkfifo(kept)
    assert load() is None
    kept.unlink()
    kept.symlink_to("/dev/zero")
    assert load() is None


@pytest.mark.skipif(os.getuid() != 0, reason="only root may give files away")
def test_machine_code_of_another_user_is_not_run(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert load() is not None
    os.chown(kept, 1234, -1)
    assert load() is None
    source = Path(start.__file__)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert trusted_owners(source) == {0, os.getuid(), source.stat().st_uid}
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/somewhere")
    assert trusted_owners(source) is None


def test_a_home_that_is_no_absolute_path_leads_to_no_folder_below_the_present_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", "relative")
    assert machine_code_cache._user_cache() is None


def test_a_file_that_cannot_be_written_is_said_once(kept: Path, caplog: pytest.LogCaptureFixture) -> None:
    kept.unlink()
    kept.mkdir()
    assert load() is None
    save()
    save()
    (said,) = caplog.messages
    assert "Is a directory" in said
    assert list(kept.parent.iterdir()) == [kept]


def test_a_folder_that_was_removed_is_made_again(kept: Path) -> None:
    shutil.rmtree(kept.parent)
    assert load() is None
    save()
    assert kept.exists()


def test_a_folder_that_cannot_be_written_stops_nothing() -> None:
    assert "/proc" not in run_start(Path("/proc/gridslam"))


def test_an_installation_that_was_warmed_up_serves_those_who_cannot_write_into_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine_code_cache, "_is_writable", lambda folder: str(tmp_path) in str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache_directory.cache_clear()
    own, ready = folders_of(Path(raycast.__file__))
    cache_directory.cache_clear()
    assert own == tmp_path / "gridslam" / "kernels" / ready.name
    assert ready.parent == Path(raycast.__file__).parent / "__pycache__" / "kernels"


@pytest.mark.parametrize("home", ["", "relative", "/proc/home"])
def test_without_any_folder_the_one_beside_the_sources_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, home: str
) -> None:
    def no_folder() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(machine_code_cache, "_is_writable", lambda folder: False)
    monkeypatch.setattr(tempfile, "gettempdir", no_folder)
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    machine_code_cache._private_temporary_folder.cache_clear()
    (tmp_path / "loops.py").write_text("")
    assert folder_of(tmp_path / "loops.py").parent == tmp_path / "__pycache__" / "kernels"
    cache_directory.cache_clear()


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
