"""Wrong extrinsics of a fixed camera are found by the robot's passes, and right ones are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.methods.ispace_mcl.cameras.robot_passes import RobotPasses, about

PLACE = np.array([2.0, 1.0])


def detections(
    pose: np.ndarray, rng: np.random.Generator, count: int = 40
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Detections by a camera whose given extrinsics are off by `pose` `(3,)`, and the robot's positions."""
    pairs = []
    for k in range(count):
        robot = PLACE + np.array([1.5 + 0.35 * (k % 16), 0.8 * np.sin(0.7 * k)])
        away = (robot - PLACE) / np.hypot(*(robot - PLACE))
        side = robot - 0.18 * away + rng.normal(0.0, 0.05, 2)
        if k % 9 == 0:
            side = side + rng.normal(0.0, 0.6, 2)  # a person
        pairs.append((se2.transform_points(se2.inverse(pose), side[None])[0], robot))
    return pairs


@pytest.mark.parametrize("seed", range(4))
def test_wrong_extrinsics_are_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shift = np.array([0.05, -0.04, np.radians(2.0)]) * rng.choice([-1.0, 1.0], 3)
    passes = RobotPasses(PLACE)
    for seen, robot in detections(about(PLACE, shift), rng):
        applied = passes.applied
        passes.add(seen if applied is None else se2.transform_points(applied.pose, seen[None])[0], robot)
    found = passes.applied
    assert found is not None
    assert np.abs(found.shift[:2] - shift[:2]).max() < 0.06
    assert abs(found.shift[2] - shift[2]) < np.radians(0.8)
    assert found.after_m < 0.6 * found.before_m
    assert len(passes.notes()) == 1


@pytest.mark.parametrize("seed", range(4))
def test_right_extrinsics_are_left_alone(seed: int) -> None:
    passes = RobotPasses(PLACE)
    for seen, robot in detections(np.zeros(3), np.random.default_rng(seed)):
        assert passes.add(seen, robot) is None
    assert passes.notes() == []


def test_a_camera_that_is_moved_in_mid_log_is_noticed_and_corrected_anew() -> None:
    rng = np.random.default_rng(9)
    passes = RobotPasses(PLACE)
    shift = np.array([0.1, 0.3, np.radians(4.0)])
    for seen, robot in [*detections(np.zeros(3), rng), *detections(about(PLACE, shift), rng)]:
        applied = passes.applied
        passes.add(seen if applied is None else se2.transform_points(applied.pose, seen[None])[0], robot)
    assert passes.applied is not None
    assert np.abs(passes.applied.shift - shift).max() < 0.1
    assert "was moved" in passes.notes()[0]
