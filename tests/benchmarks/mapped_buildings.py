"""Drives through buildings by seed, with the map and the trajectory that SLAM has at the end: the truth and 2 cm of noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.range_caster import range_caster
from tests.benchmarks.wing_buildings import Building, building_of, drive_along

Floats = NDArray[np.float64]

CELL_M = 0.05
SPACING_M = 0.25  # between key scans
BEAMS = 180
MAX_RANGE_M = 20.0
NOISE_M = 0.02
MARGIN_M = 1.0


@dataclass(frozen=True)
class MappedBuilding:
    """A building, the robot's poses `(n, 3)` in it, the ranges `(n, b)` measured from there, and the map made of them."""

    building: Building
    poses: Floats
    bearings: Floats
    ranges_m: Floats
    occupancy: OccupancyGrid

    def points(self, row: int) -> Floats:
        """The endpoints `(m, 2)` of a scan in the robot's frame."""
        hit = self.ranges_m[row] < MAX_RANGE_M
        directions = np.column_stack([np.cos(self.bearings), np.sin(self.bearings)])
        return np.asarray((self.ranges_m[row][:, None] * directions)[hit])


@lru_cache(maxsize=16)
def mapped_building(seed: int) -> MappedBuilding:
    """The mapped of a building."""
    building = building_of(seed)
    walls = building.walls()
    low = np.concatenate(walls).min(axis=0) - MARGIN_M
    cols, rows = (np.ceil((np.concatenate(walls).max(axis=0) + MARGIN_M - low) / CELL_M)).astype(int).tolist()
    geometry = GridGeometry(CELL_M, (float(low[0]), float(low[1])))
    image = np.zeros((rows, cols), np.uint8)
    cv2.polylines(image, [_pixels(wall, geometry) for wall in walls], False, 1, 2)
    poses = drive_along(building.route(), SPACING_M)
    bearings = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    ranges = (
        range_caster(image > 0, geometry).ranges(poses, bearings, np.zeros(3), MAX_RANGE_M).astype(np.float64)
    )
    rng = np.random.default_rng([seed, 29])
    ranges += np.where(ranges < MAX_RANGE_M, rng.normal(0.0, NOISE_M, ranges.shape), 0.0)
    return MappedBuilding(
        building, poses, bearings, ranges, _map_of(poses, bearings, ranges, geometry, (rows, cols))
    )


def _map_of(
    poses: Floats, bearings: Floats, ranges: Floats, geometry: GridGeometry, shape: tuple[int, int]
) -> OccupancyGrid:
    """What the beams have passed is free, where they end is occupied."""
    free, hit = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
    for pose, distances in zip(poses, ranges, strict=True):
        ends = se2.transform_points(pose, distances[:, None] * directions)
        cv2.fillPoly(free, [_pixels(ends, geometry)], 1)
        cells = geometry.cells(ends[distances < MAX_RANGE_M])
        hit[cells[:, 0], cells[:, 1]] = 1
    probability = np.where(hit > 0, 0.9, np.where(free > 0, 0.1, np.nan)).astype(np.float32)
    return OccupancyGrid(probability, geometry)


def _pixels(points: Floats, geometry: GridGeometry) -> NDArray[np.int32]:
    return np.asarray(geometry.cells(points)[:, ::-1], np.int32)
