from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.methods.ispace_mcl.local_map import SPACING_M, local_map

NO_OFFSET = np.zeros((1, 2))


def _wall(bearings, distance_m):
    """Endpoints on a wall at x = distance_m."""
    return np.column_stack([np.full(len(bearings), distance_m), distance_m * np.tan(bearings)])


def test_a_near_wall_has_no_more_beams_than_as_much_of_a_far_one():
    near, far = _wall(np.linspace(-0.5, 0.5, 400), 2.0), -_wall(np.linspace(-0.5, 0.5, 400), 8.0)
    beams = local_map(np.zeros((1, 3)), NO_OFFSET, [np.concatenate([near, far])]).beams
    at_near = beams.endpoints[:, 0] > 0.0
    assert at_near.sum() == pytest.approx(np.ptp(near[:, 1]) / SPACING_M, abs=2)
    assert (~at_near).sum() == pytest.approx(np.ptp(far[:, 1]) / SPACING_M, abs=2)


def test_of_the_beams_that_end_at_a_place_the_shortest_counts():
    end = np.array([[5.1, 0.1]])
    poses = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])  # latest first
    points = [se2.transform_points(se2.inverse(pose), end) for pose in poses]
    found = local_map(poses, np.zeros((3, 2)), points)
    assert found.scans.tolist() == [1]
    np.testing.assert_allclose(found.beams.origins, [[3.0, 0.0]])
    np.testing.assert_allclose(found.beams.endpoints, end)


def test_people_whom_later_scans_pass_are_left_out_and_what_stands_remains():
    bearings = np.linspace(-0.6, 0.6, 121)
    scans = []
    for k in range(6):  # a person walks to the side in front of a wall; a box stands there all the time
        points = _wall(bearings, 5.0)
        points[10 + 15 * k : 20 + 15 * k] *= 0.5
        points[100:110] *= 0.4
        scans.append(points)
    endpoints = local_map(np.zeros((6, 3)), np.zeros((6, 2)), scans).beams.endpoints
    is_wall, is_box = endpoints[:, 0] > 4.9, endpoints[:, 0] < 2.1
    assert is_box.any()
    assert is_wall.sum() >= 0.8 * np.ptp(scans[0][:, 1]) / SPACING_M
    assert (~is_wall & ~is_box).sum() == 0


def test_scans_without_points_show_nothing():
    found = local_map(np.zeros((2, 3)), np.zeros((2, 2)), [np.zeros((0, 2)), np.zeros((0, 2))])
    assert len(found.beams) == len(found.scans) == 0
