from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.core.files import (
    check_file_free,
    partial_file,
    partial_folder,
    put_file,
    put_folder,
    refuse_to_replace,
    remove_left_over,
    write_atomic,
)
from gridslam.core.plain_files import read_plain_file


def test_a_file_appears_when_it_is_complete_with_the_rights_of_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    with partial_file(tmp_path / "a") as stream:
        stream.write(b"whole")
        assert not (tmp_path / "a").exists()
        put_file(stream, tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == b"whole"
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "plain"]


def test_what_is_not_put_in_place_is_removed(tmp_path: Path) -> None:
    with partial_file(tmp_path / "a") as stream:
        stream.write(b"half")
    with pytest.raises(KeyboardInterrupt), partial_folder(tmp_path / "b") as folder:
        (folder / "half").touch()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_errors_of_the_system_name_the_output_and_not_what_is_temporary(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError, match="taken'") as error:
        write_atomic(tmp_path / "taken", b"")
    assert error.value.filename == str(tmp_path / "taken")
    with pytest.raises(OSError, match="nothing"), partial_folder(tmp_path / "out") as folder:
        (folder / "nothing" / "file").touch()
    with pytest.raises(OSError, match="device") as error, partial_folder(tmp_path / "out") as folder:
        write_to_a_full_disk()
    assert error.value.filename == str(tmp_path / "out")
    with pytest.raises(OSError, match="map") as error, partial_folder(tmp_path / "out") as folder:
        (folder / "map.pgm").mkdir()
        write_atomic(folder / "map.pgm", b"")
    assert error.value.filename == str(tmp_path / "out" / "map.pgm")


def write_to_a_full_disk() -> None:
    with Path("/dev/full").open("wb", buffering=0) as stream:
        stream.write(b"x")


def test_errors_of_other_files_keep_their_name(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="input") as error, partial_file(tmp_path / "out"):
        (tmp_path / "input").read_bytes()
    assert error.value.filename == str(tmp_path / "input")


def test_files_that_killed_processes_have_left_are_removed_as_folders_are(tmp_path: Path) -> None:
    left = tmp_path / ".log.mcap.abcdefgh.partial"
    left.write_bytes(b"half")
    os.utime(left, (0, 0))
    with partial_file(tmp_path / "log.mcap") as stream:
        os.utime(stream.name, (0, 0))
        remove_left_over(tmp_path / "log.mcap")
        assert [path.name for path in tmp_path.iterdir()] == [Path(stream.name).name]  # its writer is at work


def test_a_folder_takes_the_place_of_another(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").touch()
    with partial_folder(tmp_path / "out") as folder:
        (folder / "new").touch()
        put_folder(folder, tmp_path / "out")
    assert [path.name for path in tmp_path.rglob("*")] == ["out", "new"]


def test_only_a_file_is_replaced_by_a_file_and_only_with_force(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    check_file_free(tmp_path / "file", force=True)
    check_file_free(tmp_path / "new", force=False)
    with pytest.raises(ConfigError, match="--force"):
        check_file_free(tmp_path / "file", force=False)
    for name in ("folder", "pipe"):
        with pytest.raises(ConfigError, match="never replaced"):
            check_file_free(tmp_path / name, force=True)
    with pytest.raises(ConfigError, match="not a folder"):
        check_file_free(tmp_path / "nowhere" / "file", force=True)


def test_a_name_is_refused_exactly_when_its_temporary_name_would_be_too_long(tmp_path: Path) -> None:
    longest = os.pathconf(tmp_path, "PC_NAME_MAX") - len("..12345678.partial")
    check_file_free(tmp_path / ("x" * longest), force=False)
    write_atomic(tmp_path / ("x" * longest), b"")
    with pytest.raises(ConfigError, match="longer than"):
        check_file_free(tmp_path / ("x" * (longest + 1)), force=False)
    with pytest.raises(ConfigError, match="longer than"):
        check_file_free(tmp_path / ("é" * (longest // 2 + 1)), force=False)


def test_an_input_is_not_replaced_however_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "link").symlink_to("run")
    log = tmp_path / "run" / "log.mcap"
    for target in (log, tmp_path / "run", tmp_path / "link", tmp_path / "run" / ".." / "run"):
        with pytest.raises(ConfigError, match="would replace the input"):
            refuse_to_replace(target, [log])
    refuse_to_replace(tmp_path / "run2", [log])


def test_a_small_file_is_read_with_little_memory_whatever_the_limit(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"x" * 3_000_000)
    tracemalloc.start()
    assert len(read_plain_file(tmp_path / "a", 1 << 30)) == 3_000_000
    assert tracemalloc.get_traced_memory()[1] < 20_000_000
    tracemalloc.stop()
    with pytest.raises(OSError, match="larger than 2999999 bytes"):
        read_plain_file(tmp_path / "a", 2_999_999)
