"""Scans are compared with their mirror images on right and on mirrored maps."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.methods.ispace_mcl.mirror_check import MAX_CHECKS, MIN_CHECKS, MirrorCheck
from gridslam.sensors.likelihood_field import distance_field
from gridslam.sensors.pose_search import PoseHypotheses
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import BeamSegments, VisibilityField
from tests.methods.ispace_mcl.building import BEAMS, LIDAR, building, scan_at

POSE = np.array([-1.0, 3.8, 0.1])


def beams() -> BeamSegments:
    grid = building()
    ranges = scan_at(grid, grid.probability > 0.5, POSE)
    angles = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + LIDAR[:2]
    return BeamSegments(np.broadcast_to(LIDAR[:2], points.shape), points)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_the_mirror_image_of_the_scans_fits_a_mirrored_map_better(is_mirrored: bool) -> None:
    grid = building()
    occupied = np.ascontiguousarray((grid.probability > 0.5)[:: -1 if is_mirrored else 1])
    visibility = VisibilityField(
        distance_field(occupied, grid.geometry, 2.0), range_caster(occupied, grid.geometry), 0.4, 0.3
    )
    top = 2.0 * grid.geometry.origin_xy_m[1] + len(occupied) * grid.geometry.resolution_m
    image = np.array([POSE[0], top - POSE[1], -POSE[2]])  # of the pose in the mirrored map
    searches = []

    def search(searched: BeamSegments) -> PoseHypotheses:
        searches.append(searched)
        return PoseHypotheses(np.array([image]), np.zeros(1))

    check = MirrorCheck(search, visibility)
    check.add(beams(), np.array([POSE]))
    assert not check.is_mirrored  # one window is not enough
    for _ in range(2 * MAX_CHECKS):
        check.add(beams(), np.array([POSE]))
    assert check.is_mirrored == is_mirrored
    assert len(searches) == (MAX_CHECKS if is_mirrored else MIN_CHECKS)  # clear on the right map at once
