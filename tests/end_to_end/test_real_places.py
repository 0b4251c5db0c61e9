"""Real logs become maps that agree with what others measured there."""

from __future__ import annotations

import bz2
import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from tests.conftest import Program

LONGEST_M = 0.5  # what is farther from every wall of the other map was not there when that was made


def walls_of(occupancy: OccupancyGrid) -> NDArray[np.float64]:
    """Centres of the occupied cells `(n, 2)`, metres."""
    rows, cols = np.nonzero(np.nan_to_num(occupancy.probability, nan=0.5) > 0.65)
    geometry = occupancy.geometry
    return np.column_stack([cols + 0.5, rows + 0.5]) * geometry.resolution_m + geometry.origin_xy_m


def turned(points: NDArray[np.float64], x_m: float, y_m: float, yaw_rad: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return points @ np.array([[cosine, sine], [-sine, cosine]]) + (x_m, y_m)


@pytest.mark.real_data
@pytest.mark.filterwarnings("ignore:.*free_thresh 0.25 makes")
def test_a_drive_through_a_corridor_lies_on_the_map_of_its_floor(
    program: Program, data_dir: Path, tmp_path: Path
) -> None:
    bag = data_dir / "ros2" / "macfirst_floor_take_2_0.db3"
    done = program("map", bag, "-c", "slam-sd", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    walls = walls_of(load_any_map(tmp_path / "run" / "map.yaml"))
    floor = cKDTree(walls_of(load_any_map(data_dir / "ros2" / "mac_1st_floor_final.yaml")))

    def distances(pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(floor.query(turned(walls, *pose))[0], LONGEST_M)

    where = least_squares(distances, [6.8, -8.3, 1.7], loss="soft_l1", f_scale=0.05, diff_step=1e-4)
    assert np.median(distances(where.x)) < 0.05
    assert np.mean(distances(where.x) < 0.1) > 0.7


@pytest.mark.real_data
def test_the_beginning_of_a_benchmark_log_holds_its_relations(
    program: Program, data_dir: Path, tmp_path: Path
) -> None:
    carmen = tmp_path / "beginning.clf"
    with bz2.open(data_dir / "lidar" / "aces.clf.bz2") as log:
        carmen.write_bytes(b"".join(islice(log, 4000)))
    done = program("map", carmen, "-c", "slam-sd", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    relations = data_dir / "lidar" / "aces.relations"
    measured = program("evaluate", tmp_path / "run", "--relations", relations, "--json")
    found = json.loads(measured.stdout)["relations"]
    assert found["count"] > 200
    assert found["trans"]["mean"] < 0.060  # GMapping's mean over the whole log
