from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import LaserScan, Transform, readonly
from gridslam.kernels.scan_matching.scan_points import LEVEL
from gridslam.logs.rotations import from_euler
from gridslam.sensors.lidar_beams import LidarExtrinsics, beams_of, extrinsics_of


def _scan(ranges, range_max=10.0, angle_min=0.0, increment=math.pi / 2):
    return LaserScan(0, "laser", readonly(ranges, np.float32), angle_min, increment, 0.2, range_max)


def test_nan_negative_and_short_readings_are_left_out_and_counted():
    beams = beams_of(_scan([1.0, np.nan, -1.0, 0.1, 2.0]), LidarExtrinsics(np.zeros(3)), 0.0, 50.0)
    assert beams.unreadable == 3
    np.testing.assert_allclose(beams.ranges, [1.0, 2.0])


def test_infinities_and_readings_at_the_maximum_range_are_beams_without_return():
    beams = beams_of(_scan([1.0, np.inf, 10.0, 12.0]), LidarExtrinsics(np.zeros(3)), 0.0, 50.0)
    assert beams.returned.tolist() == [True, False, False, False]
    np.testing.assert_allclose(beams.ranges, [1.0, 10.0, 10.0, 10.0])
    assert len(beams.points) == 1
    assert beams_of(_scan([1.0, 6.0]), LidarExtrinsics(np.zeros(3)), 0.0, 5.0).max_range_m == 5.0


def test_points_are_in_the_robots_frame():
    beams = beams_of(_scan([1.0, 2.0]), LidarExtrinsics(np.array([0.5, 0.25, math.pi / 2])), 0.0, 50.0)
    np.testing.assert_allclose(beams.points, [[0.5, 1.25], [-1.5, 0.25]], atol=1e-9)


def test_a_lidar_upside_down_scans_in_the_other_direction():
    # Half a turn about the forward axis: the beam to the sensor's left points to the robot's right.
    extrinsics = extrinsics_of(
        Transform(0, "base_link", "laser", (0.3, 0.0, 0.5), (0.0, 1.0, 0.0, 0.0), True)
    )
    assert extrinsics.flipped
    beams = beams_of(_scan([1.0, 2.0]), extrinsics, 0.0, 50.0)
    np.testing.assert_allclose(beams.points, [[1.3, 0.0], [0.3, -2.0]], atol=1e-6)


def test_upside_down_about_the_sideways_axis_faces_backwards():
    extrinsics = extrinsics_of(
        Transform(0, "base_link", "laser", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), True)
    )
    beams = beams_of(_scan([1.0, 2.0]), extrinsics, 0.0, 50.0)
    np.testing.assert_allclose(beams.points, [[-1.0, 0.0], [0.0, 2.0]], atol=1e-6)


def test_subsampled_beams_keep_their_points():
    ranges = np.where(np.arange(100) % 3 == 0, np.inf, 1.0 + 0.01 * np.arange(100))
    beams = beams_of(_scan(ranges, increment=0.01), LidarExtrinsics(np.zeros(3)), 0.0, 50.0)
    few = beams.subsampled(17)
    assert len(few.ranges) == 17
    assert few.returned.sum() == len(few.points)
    np.testing.assert_allclose(np.hypot(*few.points.T), few.ranges[few.returned], rtol=1e-6)
    assert beams.subsampled(200) is beams


@pytest.mark.parametrize("euler", [(0.1, -0.2, 0.4), (math.pi + 0.1, 0.05, -2.0)])
def test_beams_of_a_tilted_lidar_end_where_its_points_are_seen_from_above(
    euler: tuple[float, float, float],
) -> None:
    quat = from_euler(*euler)
    extrinsics = extrinsics_of(Transform(0, "base_link", "laser", (0.2, 0.1, 0.5), quat, is_static=True))
    beams = beams_of(_scan([1.0, 2.0, 3.0]), extrinsics, 0.0, 50.0)
    bearings = math.pi / 2 * np.arange(3)
    rays = np.array([1.0, 2.0, 3.0]) * np.stack([np.cos(bearings), np.sin(bearings), np.zeros(3)])
    expected = (rotation_matrix(quat) @ rays)[:2].T + np.array([0.2, 0.1])
    np.testing.assert_allclose(beams.points, expected, atol=1e-6)
    assert (
        extrinsics_of(Transform(0, "a", "b", (0.0, 0.0, 0.0), from_euler(0.003, 0.0, 1.0))).projection
        == LEVEL
    )
