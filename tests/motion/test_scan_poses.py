from __future__ import annotations

import numpy as np

from gridslam.core.messages import LaserScan, Odometry, readonly
from gridslam.motion.odometry_limits import OdometryLimits
from gridslam.motion.scan_poses import PlacedScan, ScanPoses, twist_between

NS = 10**9


def _scan(seconds):
    return LaserScan(int(seconds * NS), "laser", readonly([1.0], np.float32), 0.0, 0.1, 0.0, 10.0)


def _odometry(seconds, x, yaw=0.0):
    return Odometry(int(seconds * NS), "odom", x, 0.0, yaw)


def _join(*events):
    scans = ScanPoses(OdometryLimits(2.0, 3.0, 0.3, 0.3))
    placed = []
    for event in events:
        take = scans.add_scan if isinstance(event, LaserScan) else scans.add_odometry
        placed += list(take(event))
    return scans, placed


def test_a_scan_waits_for_the_odometry_that_reaches_its_stamp():
    _, placed = _join(_odometry(0.0, 0.0), _scan(0.25))
    assert placed == []
    _, placed = _join(_odometry(0.0, 0.0), _scan(0.25), _odometry(1.0, 1.0))
    np.testing.assert_allclose(placed[0].odometry, [0.25, 0.0, 0.0])


def test_scans_keep_their_order():
    _, placed = _join(_odometry(0.0, 0.0), _scan(0.1), _scan(0.2), _odometry(0.3, 0.3))
    assert [p.scan.stamp_ns for p in placed] == [NS // 10, NS // 5]


def test_a_scan_with_the_stamp_of_the_last_odometry_does_not_wait():
    _, placed = _join(_odometry(0.0, 0.0), _odometry(0.5, 0.4), _scan(0.5))
    np.testing.assert_allclose(placed[0].odometry, [0.4, 0.0, 0.0])


def test_a_scan_before_all_odometry_takes_the_first_pose_and_is_counted():
    scans, placed = _join(_scan(0.0), _odometry(0.1, 3.0))
    np.testing.assert_allclose(placed[0].odometry, [3.0, 0.0, 0.0])
    assert scans.counters["scan.before_first_odometry"] == 1


def test_scans_after_the_last_odometry_are_placed_at_the_end():
    scans, placed = _join(_odometry(0.0, 1.0), _scan(2.0))
    assert placed == []
    assert [p.odometry[0] for p in scans.flush()] == [1.0]
    assert scans.counters["scan.after_last_odometry"] == 1


def test_without_odometry_every_scan_is_counted_as_skipped():
    scans, _ = _join(_scan(0.0), _scan(1.0))
    assert list(scans.flush()) == []
    assert scans.counters["skipped.scan.no_odometry"] == 2


def test_a_jump_is_removed_from_the_motion_and_marked_at_the_next_scan():
    scans, placed = _join(
        _odometry(0.0, 0.0),
        _odometry(0.1, 0.1),
        _odometry(0.2, 50.0),
        _scan(0.2),
        _odometry(0.3, 50.1),
        _scan(0.3),
    )
    assert [p.odometry_jumped for p in placed] == [True, False]
    np.testing.assert_allclose([p.odometry[0] for p in placed], [0.1, 0.2])
    assert scans.counters["odometry.jumps"] == 1


def test_a_long_gap_is_no_jump_but_is_counted():
    scans, _ = _join(_odometry(0.0, 0.0), _odometry(5.0, 3.0))
    assert scans.counters["odometry.jumps"] == 0
    assert scans.counters["odometry.gaps"] == 1


def test_odometry_that_is_not_finite_is_skipped():
    scans, placed = _join(_odometry(0.0, float("nan")), _odometry(0.1, 1.0), _scan(0.1))
    assert scans.counters["skipped.odom.not_finite"] == 1
    assert placed[0].odometry[0] == 1.0


def test_out_of_order_stamps_keep_the_recorded_order():
    scans, placed = _join(_odometry(1.0, 0.0), _odometry(2.0, 0.1), _odometry(1.5, 0.2), _scan(1.5))
    assert placed[0].odometry[0] == 0.2
    assert scans.counters["odometry.jumps"] == 0


def test_the_twist_is_motion_over_time_and_zero_after_a_gap():
    def placed(seconds, x, yaw=0.0):
        return PlacedScan(_scan(seconds), np.array([x, 0.0, yaw]), False)

    np.testing.assert_allclose(twist_between(placed(1.0, 0.0), placed(1.2, 0.1, 0.05)), [0.5, 0.0, 0.25])
    for last, now in (
        (None, placed(1.0, 1.0)),
        (placed(1.0, 0.0), placed(9.0, 4.0)),
        (placed(2.0, 0.0), placed(1.0, 1.0)),
    ):
        assert not twist_between(last, now).any()


def test_a_scan_before_the_clock_was_set_back_does_not_wait_for_the_new_clock():
    _, placed = _join(
        _odometry(7.3, 1.0), _odometry(7.4, 1.1), _scan(7.45), _odometry(1.5, 1.2), _scan(1.5), _odometry(1.6, 1.3), _scan(1.6)
    )  # fmt: skip
    assert [p.scan.stamp_ns for p in placed] == [int(t * NS) for t in (7.45, 1.5, 1.6)]
    np.testing.assert_allclose([p.odometry[0] for p in placed], [1.1, 1.2, 1.3])
