"""The search of lost particles for their maps: the recent path must match, not the last scan alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.drift import Drift
from gridslam.methods.slam_sd.map_search import RecentSubmap, Search, search_maps
from gridslam.methods.slam_sd.particle_grids import Matches, ParticleGrids

Floats = NDArray[np.float64]

PARTICLES = 2
BACK = np.array([-4.0, 0.0, 0.0])  # the earlier scan in the frame of the last one


def corner_scan(depth_m: float) -> PreparedScan:
    """Points of a wall to the left, and of a niche of some depth to the right."""
    x, y = np.linspace(-1.5, 1.5, 40), np.linspace(0.0, depth_m, 20)
    left = np.column_stack([x, np.full(40, 2.0)])
    sides = np.concatenate(
        [np.column_stack([np.full(20, -1.0), -1.0 - y]), np.column_stack([np.full(20, 1.0), -1.0 - y])]
    )
    points = np.concatenate([left, sides])
    normals = np.repeat([[0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]], [40, 20, 20], axis=0)
    return PreparedScan(0, np.zeros(2), points, points, normals, points, normals)


def searched(earlier: PreparedScan) -> Matches:
    """The search of a robot at the origin of maps of two equal niches, of which the earlier scan may show the first."""
    grids = ParticleGrids(PARTICLES, 100.0)
    for pose in (BACK, np.zeros(3)):
        grids.insert(corner_scan(1.0), np.tile(pose, (PARTICLES, 1)))
    predicted = np.tile([0.4, 0.3, 0.03], (PARTICLES, 1))
    recent = RecentSubmap([(corner_scan(1.0), np.zeros(3)), (earlier, BACK)])
    search = Search(predicted, Drift(PARTICLES), np.array([True, False]))
    return search_maps(grids, recent, search, 0.6, np.random.default_rng(0))


def test_a_lost_particle_finds_the_pose_at_which_all_recent_scans_match() -> None:
    found = searched(corner_scan(1.0))
    assert found.inlier_ratio[0] > 0.9
    np.testing.assert_allclose(found.poses[0], 0.0, atol=0.02)
    assert found.inlier_ratio[1] == 0.0  # it was not lost


def test_a_pose_at_which_the_last_scan_alone_matches_is_refused() -> None:
    elsewhere = corner_scan(1.0)
    turned = se2.transform_points(np.array([0.0, 0.0, 0.7]), elsewhere.points)
    normals = se2.transform_points(np.array([0.0, 0.0, 0.7]), elsewhere.normals)
    assert not searched(
        PreparedScan(0, np.zeros(2), turned, turned, normals, turned, normals)
    ).inlier_ratio.any()


def test_a_submap_joins_scans_by_the_motion_of_the_front_end() -> None:
    track = [np.array([0.5 * k, 0.1 * k, 0.02 * k]) for k in range(13)]
    world = np.array([[3.0, 2.0], [4.0, 2.0]])
    scans = [
        PreparedScan(0, np.zeros(2), seen, seen, np.tile([0.0, -1.0], (2, 1)), seen, seen)
        for seen in (se2.transform_points(se2.inverse(pose), world) for pose in track)
    ]
    submap = RecentSubmap.of(scans, track)
    assert len(submap.scans) == 3
    points = se2.transform_points(track[-1], submap.points().points)
    assert points == pytest.approx(np.tile(world, (3, 1)))
