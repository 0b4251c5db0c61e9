"""Patterns and folders that stand for logs."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError, LogError
from gridslam.logs import open_log
from gridslam.logs.config import LogConfig
from gridslam.logs.convert import convert_log
from gridslam.logs.find import find_logs
from gridslam.logs.write import write_log


@pytest.fixture
def folder(small_log: Path, tmp_path: Path) -> Path:
    """Two MCAP files of different names, a CSV folder, and files that are not logs."""
    with open_log(small_log) as log:
        events = list(log.events())
    for name in ("monday.mcap", "tuesday.mcap"):
        write_log(tmp_path / name, events)
    shutil.copytree(small_log, tmp_path / "wednesday")
    (tmp_path / "wednesday.truth").mkdir()
    (tmp_path / "notes.txt").write_text("rain")
    return tmp_path


def test_a_folder_of_logs_stands_for_them_in_the_order_of_their_names(folder: Path) -> None:
    assert [log.name for log in find_logs(folder)] == ["monday.mcap", "tuesday.mcap", "wednesday"]


def test_a_pattern_stands_for_its_matches(folder: Path) -> None:
    assert [log.name for log in find_logs(folder / "*day.mcap")] == ["monday.mcap", "tuesday.mcap"]
    with pytest.raises(LogError, match="matches no file"):
        find_logs(folder / "*.bag")


def test_a_log_stands_for_itself(folder: Path) -> None:
    (folder / "split").mkdir()
    with open_log(folder / "monday.mcap") as log:
        events = list(log.events())
    for number, part in enumerate((events[:100], events[100:])):
        write_log(folder / "split" / f"drive_{number}.mcap", part)
    for name in ("monday.mcap", "wednesday", "split", "nowhere"):
        assert find_logs(folder / name) == [folder / name]
    (folder / "odd[1].mcap").write_bytes((folder / "monday.mcap").read_bytes())
    assert find_logs(folder / "odd[1].mcap") == [folder / "odd[1].mcap"]


def test_only_the_part_between_start_and_end_is_read(small_log: Path) -> None:
    with open_log(small_log) as log:
        whole = [event.stamp_ns for event in log.events()]
        start = log.start_ns
    with open_log(small_log, LogConfig(start_s=1.0, end_s=2.5)) as log:
        part = [event.stamp_ns for event in log.events()]
        read = sum(
            n for key, n in log.counters.items() if key.startswith("read.") and "extrinsics" not in key
        )
        assert not log.is_lossy
    first, last = start + 10**9, start + 2_500_000_000
    assert part[1:] == [stamp for stamp in whole[1:] if first <= stamp <= last]  # after the extrinsics
    assert read == len(part) - 1


def test_a_span_that_the_log_does_not_have_is_refused(small_log: Path) -> None:
    with (
        open_log(small_log, LogConfig(start_s=1000.0)) as log,
        pytest.raises(ConfigError, match=r"only 5\.9 s"),
    ):
        list(log.events())
    with pytest.raises(ValueError, match="is not before"):
        LogConfig(start_s=2.0, end_s=1.0)


def test_a_name_that_is_too_long_is_refused_in_a_line() -> None:
    with pytest.raises(LogError, match="File name too long"):
        find_logs("x" * 5000)


def test_a_folder_of_logs_is_no_log_and_the_error_names_them(folder: Path) -> None:
    with pytest.raises(
        LogError, match=r"a folder with 3 logs: monday.mcap, tuesday.mcap, wednesday; name one"
    ):
        open_log(folder)


def test_a_recording_that_is_cut_and_converted_is_one_log_again(small_log: Path, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    for number, (start_s, end_s) in enumerate([(None, 1.0), (1.0, 2.0), (2.0, None)]):
        with open_log(small_log) as log:
            convert_log(log, tmp_path / "parts" / f"drive_{number}.mcap", start_s=start_s, end_s=end_s)
            whole = {event.stamp_ns for event in log.events()}
    with open_log(tmp_path / "parts") as log:
        assert {event.stamp_ns for event in log.events()} == whole
