from __future__ import annotations

from pathlib import Path

from gridslam.core.messages import LaserScan, Odometry
from gridslam.logs import open_log
from tests.logs.ros_samples import odometry, scan, write_mcap

S = 10**9


def looped(path: Path, shift_ns: int) -> Path:
    """Ten seconds of scans and odometry, twice; the second time later by `shift_ns`."""
    messages = [
        (topic, made(i * S + (shift_ns if again else 0)))
        for again in (False, True)
        for i in range(10, 20)
        for topic, made in (("/odom", odometry), ("/scan", scan))
    ]
    return write_mcap(path, messages)


def test_what_a_looped_playback_gave_twice_is_read_once(tmp_path: Path) -> None:
    with open_log(looped(tmp_path / "a.mcap", 0), kinds=["scan", "odom"]) as log:
        events = list(log.events())
        assert log.counters["repeated.scan"] == log.counters["repeated.odom"] == 10
        assert any("played in a loop" in line for line in log.problems)
    for kind in (LaserScan, Odometry):
        assert [e.stamp_ns for e in events if isinstance(e, kind)] == [i * S for i in range(10, 20)]


def test_a_clock_that_was_set_back_repeats_nothing(tmp_path: Path) -> None:
    with open_log(looped(tmp_path / "a.mcap", 1000), kinds=["scan", "odom"]) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 20
        assert "repeated.scan" not in log.counters


def test_a_conversion_keeps_both_passes(tmp_path: Path) -> None:
    with open_log(looped(tmp_path / "a.mcap", 0)) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 20


def test_a_looped_playback_of_scans_alone_is_read_once(tmp_path: Path) -> None:
    messages = [("/scan", scan(i * S)) for _ in range(2) for i in range(10, 20)]
    with open_log(write_mcap(tmp_path / "a.mcap", messages), kinds=["scan"]) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 10
