"""Scans made from depth images against the ranges that a lidar at the camera's position would measure."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.messages import DepthImage, readonly
from gridslam.sensors.depth_ranges import DepthBand, depth_scan, planar_extrinsics
from gridslam.sensors.pinhole import Pinhole

ROWS, COLS, FOCAL = 60, 80, 70.0
BAND = DepthBand(min_height_m=0.1, max_height_m=1.0, max_range_m=6.0)


def camera(pitch_deg: float, yaw_deg: float, position: tuple[float, float, float]) -> Pinhole:
    """A camera of the robot with a yaw, tilted down by its pitch."""
    c, s = math.cos(math.radians(pitch_deg)), math.sin(math.radians(pitch_deg))
    cy, sy = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    heading = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    forward, right = heading @ [c, 0.0, -s], heading @ [0.0, -1.0, 0.0]
    rotation = np.column_stack([right, np.cross(forward, right), forward])
    return Pinhole((FOCAL, FOCAL), (0.5 * (COLS - 1), 0.5 * (ROWS - 1)), rotation, np.array(position))


def image_of(pinhole: Pinhole, wall_x: float, post: bool = False) -> DepthImage:
    """A wall across the view at `wall_x`, the floor, and a post 20 cm wide and 2 m high a metre and a half ahead."""
    v, u = np.mgrid[:ROWS, :COLS]
    rays = np.stack([(u - pinhole.centre_px[0]) / FOCAL, (v - pinhole.centre_px[1]) / FOCAL, np.ones_like(u)])
    x, y, z = pinhole.rotation @ rays.reshape(3, -1)
    px, py, pz = pinhole.position
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(x > 0, (wall_x - px) / x, np.inf)
        depth = np.minimum(depth, np.where(z < 0, -pz / z, np.inf))
        at_post = (1.5 - px) / x
        hits = (np.abs(py + at_post * y) < 0.1) & (x > 0) & (pz + at_post * z < 2.0)
    if post:
        depth = np.where(hits, np.minimum(depth, at_post), depth)
    depth[~np.isfinite(depth)] = np.nan
    return DepthImage(5, "eye", readonly(depth.reshape(ROWS, COLS), np.float32))


@pytest.mark.parametrize(("pitch", "yaw", "y"), [(0.0, 0.0, 0.0), (15.0, 0.0, 0.1), (5.0, 30.0, -0.2)])
def test_a_wall_is_where_a_lidar_would_see_it(pitch: float, yaw: float, y: float) -> None:
    pinhole = camera(pitch, yaw, (0.2, y, 0.6))
    scan = depth_scan(image_of(pinhole, wall_x=3.0), pinhole, BAND)
    extrinsics = planar_extrinsics(pinhole).pose
    assert extrinsics == pytest.approx([0.2, y, math.radians(yaw)])
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    known = np.isfinite(scan.ranges_m)
    assert known.mean() > 0.85
    across = 0.2 + scan.ranges_m[known] * np.cos(angles[known] + extrinsics[2])
    # A beam takes the nearest of the columns within half a beam: at a slanted wall that is a little nearer.
    slack = 3.0 * scan.angle_increment_rad * math.tan(math.radians(yaw) + 0.55)
    assert across.max() < 3.0 + 0.5 * slack + 1e-3
    assert across.min() > 3.0 - slack - 1e-3


def test_the_nearest_point_of_a_column_counts_and_the_floor_does_not() -> None:
    pinhole = camera(10.0, 0.0, (0.0, 0.0, 0.5))
    scan = depth_scan(image_of(pinhole, wall_x=3.0, post=True), pinhole, BAND)
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    ahead = np.abs(1.5 * np.tan(angles)) < 0.08
    assert scan.ranges_m[ahead] == pytest.approx(1.5, abs=0.01)
    assert np.nanmin(scan.ranges_m) == pytest.approx(1.5, abs=0.01)


def test_ranges_beyond_the_maximum_are_infinite_and_those_without_depth_nan() -> None:
    pinhole = camera(0.0, 0.0, (0.0, 0.0, 0.5))
    far = depth_scan(image_of(pinhole, wall_x=7.0), pinhole, BAND)
    assert np.isposinf(far.ranges_m).all()
    image = image_of(pinhole, wall_x=3.0)
    left_half_blind = image.depth_m.copy()
    left_half_blind[:, : COLS // 2] = np.nan
    scan = depth_scan(DepthImage(5, "eye", readonly(left_half_blind, np.float32)), pinhole, BAND)
    beams = len(scan.ranges_m)  # they count from the right
    assert np.isnan(scan.ranges_m[beams // 2 + 1 :]).all()
    assert np.isfinite(scan.ranges_m[: beams // 2 - 1]).all()
    floor_only = depth_scan(
        image_of(camera(60.0, 0.0, (0.0, 0.0, 0.5)), 9.0), camera(60.0, 0.0, (0.0, 0.0, 0.5)), BAND
    )
    assert np.isnan(floor_only.ranges_m).all()
