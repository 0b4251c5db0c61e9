"""What a run says of its map's consistency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.map_consistency.assessment import MapConsistency, assess_map
from gridslam.lidar_slam.map_consistency.doubtful_places import DoubtfulPlace
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.base import RunResult
from gridslam.methods.map_consistency import with_consistency

PLACE = DoubtfulPlace("contradiction", 2.0, y_m=3.0, size_m=1.5, doubt=0.9, stamps_ns=(0, 1))


def result() -> RunResult:
    trajectory = Trajectory(np.array([0, 10**9]), np.array([(1.0, 1.0, 0.0), (4.0, 4.0, 0.0)]))
    grid = OccupancyGrid(np.full((60, 60), 0.1, np.float32), GridGeometry(0.1, (0.0, 0.0)))
    return RunResult(trajectory, occupancy=grid, measures={"key_scans": 2})


def consistency(place: DoubtfulPlace) -> MapConsistency:
    nothing = assess_map([], np.zeros((0, 3)), np.zeros((0, 3)))
    return replace(nothing, doubt=place.doubt, places=(place,))


def test_a_doubtful_map_makes_the_run_inconsistent_and_is_drawn() -> None:
    found = with_consistency(result(), consistency(PLACE))
    assert found.doubt is not None
    assert found.doubt.status == "inconsistent"
    assert "near (2.0, 3.0): one of two passages is displaced by about 1.5 m" in found.doubt.reason
    assert found.measures["key_scans"] == 2
    assert found.measures["map_consistency"]["places"][0]["x_m"] == 2.0  # type: ignore[index]
    assert (found.pictures["doubt"].rgb == (205, 45, 45)).all(axis=-1).any()  # the circle


def test_a_map_with_little_doubt_is_complete_and_its_suspect_places_are_drawn() -> None:
    found = with_consistency(result(), consistency(replace(PLACE, doubt=0.3)))
    assert found.doubt is None
    assert "doubt" in found.pictures


def test_a_map_without_suspect_places_has_no_picture_of_them() -> None:
    nothing = assess_map([], np.zeros((0, 3)), np.zeros((0, 3)))
    assert with_consistency(result(), nothing).pictures == {}
