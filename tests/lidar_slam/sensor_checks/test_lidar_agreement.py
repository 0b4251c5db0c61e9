"""Of two lidars the one with another clock, sense or place is found, named and corrected."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks import lidar_agreement
from gridslam.lidar_slam.sensor_checks.lidar_agreement import LidarFault, LidarPath, find_lidar_faults
from gridslam.lidar_slam.sensor_checks.motion_windows import NO_STRETCHES
from tests.lidar_slam.sensor_checks.test_heading_errors import winding

NS = 10**9
LEVEL = (1.0, 0.0, 0.0, 0.0)
SCAN = LaserScan(5 * NS, "back", np.ones(3, np.float32), -1.0, 1.0, 0.1, 9.0)


def paths(change: Callable[[Trajectory], Trajectory]) -> Callable[..., LidarPath]:
    """What tracking each lidar alone gives: the true path, and another of the lidar at the back."""
    truth = winding(40.0, 10.0)
    return lambda lidar, events, tracker: LidarPath(change(truth) if lidar == "back" else truth, NO_STRETCHES)


def found(monkeypatch: pytest.MonkeyPatch, change: Callable[[Trajectory], Trajectory]) -> list[LidarFault]:
    monkeypatch.setattr(lidar_agreement, "_path_of", paths(change))
    scans = [replace(SCAN, frame_id=name) for name in ("front", "back") for _ in range(60)]
    return find_lidar_faults(scans, Trajectory.empty(), lambda: None)  # type: ignore[arg-type,return-value]


def test_a_late_lidar_gets_its_stamps(monkeypatch: pytest.MonkeyPatch) -> None:
    (fault,) = found(monkeypatch, lambda path: replace(path, stamps_ns=path.stamps_ns + 3 * NS // 10))
    assert fault.lag_s == pytest.approx(0.3, abs=0.02)
    assert "the lidar back contradicts front: it is 0.30 s late" in fault.note
    assert fault.applied_to(SCAN).stamp_ns == SCAN.stamp_ns - round(fault.lag_s * NS)
    other = replace(SCAN, frame_id="front")
    assert fault.applied_to(other) is other


def test_a_mirrored_lidar_is_turned_over(monkeypatch: pytest.MonkeyPatch) -> None:
    (fault,) = found(monkeypatch, lambda path: replace(path, poses=path.poses * [1.0, -1.0, -1.0]))
    assert fault.is_mirrored
    assert fault.applied_to(SCAN).angle_increment_rad == -SCAN.angle_increment_rad


def test_lidars_that_agree_have_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not found(monkeypatch, lambda path: path)
    assert not find_lidar_faults([SCAN] * 100, Trajectory.empty(), lambda: None)  # type: ignore[arg-type,return-value]


def test_a_misplaced_lidar_is_moved() -> None:
    fault = LidarFault("back", "front", moved=(0.0, 0.1, math.pi / 2))
    stated = Transform(0, "base", "back", (0.2, 0.0, 0.3), LEVEL, is_static=True)
    right = fault.applied_to_transform(stated)
    np.testing.assert_allclose(right.translation_m, (0.0, 0.3, 0.3), atol=1e-9)
    np.testing.assert_allclose(right.quat_wxyz, (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))
    assert "wrong by yaw 90 deg" in fault.note
