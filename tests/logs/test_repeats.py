from __future__ import annotations

from pathlib import Path

from gridslam.core.messages import LaserScan, Odometry
from gridslam.logs import open_log
from gridslam.logs.order.repeats import copies_among
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


def joined(path: Path, late: int, is_same: bool = True) -> Path:
    """40 scans, one a second, of which a second recorder noted each `late` scans later, or another scan with its stamp."""
    order = sorted([(i, i, False) for i in range(10, 50)] + [(i + late, i, True) for i in range(10, 50)])
    return write_mcap(
        path, [("/scan", scan(i * S, [1.0 + i, 2.0, 3.0 + (again and not is_same)])) for _, i, again in order]
    )


def test_of_two_recordings_that_were_joined_each_message_is_read_once(tmp_path: Path) -> None:
    with open_log(joined(tmp_path / "a.mcap", 2), kinds=["scan"]) as log:
        assert [e.stamp_ns for e in log.events() if isinstance(e, LaserScan)] == [
            i * S for i in range(10, 50)
        ]
        assert log.counters["repeated.scan"] == 40
        assert any("recorded twice" in line for line in log.problems)


def test_messages_that_differ_are_no_copies_whatever_their_stamps(tmp_path: Path) -> None:
    with open_log(joined(tmp_path / "a.mcap", 2, is_same=False), kinds=["scan"]) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 80


def test_stamps_that_come_again_one_after_the_other_are_those_of_a_clock_that_was_set_back() -> None:
    once = list(range(0, 100 * S, S // 10))
    assert not copies_among(once).any()
    assert not copies_among([*once[:500], *once[470:]]).any()
    assert copies_among([s for k in range(2, 500) for s in (once[k], once[k - 2])]).sum() == 496
