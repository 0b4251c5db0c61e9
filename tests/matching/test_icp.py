"""Point-to-plane ICP recovers known motions, and leaves open what no wall decides."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.matching.icp import point_to_plane

WEAK = np.diag([1.0, 1.0, 10.0])


def room() -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of a room of 6 x 4 m."""
    x, y = np.linspace(-3, 3, 61), np.linspace(-2, 2, 41)
    points = np.concatenate(
        [
            np.column_stack([x, np.full(61, -2.0)]),
            np.column_stack([x, np.full(61, 2.0)]),
            np.column_stack([np.full(41, -3.0), y]),
            np.column_stack([np.full(41, 3.0), y]),
        ]
    )
    normals = np.repeat([[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]], [61, 61, 41, 41], axis=0)
    return points, normals


@pytest.mark.parametrize("motion", [(0.2, -0.1, 0.0), (0.1, 0.15, 0.08), (-0.25, 0.0, -0.1)])
def test_the_motion_between_two_scans_of_a_room_is_recovered(motion):
    former, normals = room()
    present = se2.transform_points(se2.inverse(np.array(motion)), former)
    found = point_to_plane(present, former, normals, np.zeros(3), 0.6, 0.05, 1e-3 * WEAK, iterations=40)
    assert found.pose == pytest.approx(motion, abs=2e-3)


def test_without_yaw_only_the_translation_moves():
    former, normals = room()
    start = np.array([0.0, 0.0, 0.02])
    present = se2.transform_points(se2.inverse(np.array([0.1, 0.05, 0.02])), former)
    found = point_to_plane(present, former, normals, start, 0.5, 0.05, 1e-3 * WEAK, solve_yaw=False)
    assert found.pose[2] == start[2]
    assert found.pose[:2] == pytest.approx([0.1, 0.05], abs=2e-3)


def test_along_a_bare_corridor_odometry_decides():
    x = np.linspace(-10, 10, 201)
    former = np.concatenate([np.column_stack([x, np.full(201, s)]) for s in (-1.5, 1.5)])
    normals = np.repeat([[0.0, 1.0], [0.0, -1.0]], 201, axis=0)
    odometry = np.array([0.3, 0.08, 0.0])
    found = point_to_plane(former - (0.3, 0.0), former, normals, odometry, 0.5, 0.05, WEAK)
    assert found.pose[0] == pytest.approx(0.3, abs=1e-9)
    assert found.pose[1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("n", [0, 2])
def test_with_too_few_points_the_start_stands(n):
    former, normals = room()
    start = np.array([0.1, 0.2, 0.3])
    found = point_to_plane(np.zeros((n, 2)), former, normals, start, 0.5, 0.05, WEAK)
    assert found.pose == pytest.approx(start)
    assert found.matches < 3


def test_points_without_normals_are_no_target():
    former, normals = room()
    found = point_to_plane(former, former, 0.0 * normals, np.zeros(3), 0.5, 0.05, WEAK)
    assert found.matches == 0
