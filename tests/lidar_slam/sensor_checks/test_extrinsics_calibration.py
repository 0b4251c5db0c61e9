"""A lidar whose place the log does not say is placed by the motions of the robot and of the lidar."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Transform
from gridslam.lidar_slam.sensor_checks.extrinsics_calibration import (
    assumed_extrinsics,
    extrinsics_note,
    moved_transform,
    solve_extrinsics,
    with_extrinsics,
)

LEVEL = (1.0, 0.0, 0.0, 0.0)


def motions(extrinsics: np.ndarray, scale: float = 1.0, noise: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Motions `(200, 3)` of a robot, with odometry times `scale`, and of a lidar on it."""
    rng = np.random.default_rng(3)
    moved = np.column_stack([rng.uniform(0.0, 0.6, 200), np.zeros(200), rng.uniform(-0.8, 0.8, 200)])
    inverse = np.broadcast_to(se2.inverse(extrinsics), moved.shape)
    matched = se2.compose(inverse, se2.compose(moved, np.broadcast_to(extrinsics, moved.shape)))
    return moved * [scale, scale, 1.0] + rng.normal(0.0, noise, moved.shape), matched


@pytest.mark.parametrize("yaw", [-2.8, -0.3, 0.0, 0.3, 1.57, 3.1])
@pytest.mark.parametrize("scale", [0.95, 1.0])
def test_the_place_is_found(yaw: float, scale: float) -> None:
    extrinsics = np.array([0.3, -0.1, yaw])
    found = solve_extrinsics(*motions(extrinsics, scale))
    assert found is not None
    np.testing.assert_allclose(found, extrinsics, atol=0.04)


def test_a_lidar_that_looks_forward_near_the_centre_or_moves_otherwise_gives_no_place() -> None:
    assert solve_extrinsics(*motions(np.array([0.2, 0.0, 0.05]))) is None
    moved, _ = motions(np.array([0.0, 0.0, 1.0]))
    assert solve_extrinsics(moved, moved[::-1]) is None
    assert solve_extrinsics(np.zeros((50, 3)), np.zeros((50, 3))) is None


def test_only_an_assumed_place_is_replaced() -> None:
    assumed = Transform(5, "base_link", "laser", (0.0, 0.0, 0.2), LEVEL, is_static=True)
    recorded = Transform(5, "base_link", "rear", (0.1, 0.0, 0.2), LEVEL, is_static=True)
    events: list[Event] = [assumed, recorded]
    assert assumed_extrinsics(events, "laser") is assumed
    assert assumed_extrinsics(events, "rear") is None
    assert assumed_extrinsics(events, "other") is None
    placed = with_extrinsics(assumed, np.array([0.1, 0.2, 1.57]), "base")
    assert placed.translation_m == (0.1, 0.2, 0.2)
    assert "laser is placed on base by its motion: x 0.10 m, y 0.20 m, yaw 90.0 deg" in extrinsics_note(
        placed
    )


def test_extrinsics_that_are_wrong_in_yaw_alone_keep_their_place() -> None:
    stated = Transform(0, "base", "laser", (0.1, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0), is_static=True)
    turned = moved_transform(stated, np.array([-0.01, 0.02, -math.pi / 2]))
    np.testing.assert_allclose(turned.translation_m, (0.0, -0.1, 0.3), atol=1e-9)
    moved = moved_transform(stated, np.array([0.6, 0.0, 0.01]))
    np.testing.assert_allclose(moved.translation_m, (0.7, 0.0, 0.3), atol=1e-9)
    assert moved.quat_wxyz == stated.quat_wxyz
