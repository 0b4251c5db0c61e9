"""The drawing `surfaces` of the finished map: readings averaged to wall segments, and cleared where beams pass.

A single reading is uncertain by several cells. A line is fitted to the readings of all stops in a window, and each of them is
drawn onto it. Where too few readings agree, or where beams of other stops pass, there is no wall.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared.infrared_beams import count_crossed
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ir_scan.lines import WallMoments
from gridslam.methods.ir_scan.scale import scans_of, window_of
from gridslam.methods.ir_scan.stacked_readings import StackedReadings
from gridslam.methods.ir_scan.stops import Stop
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

WINDOW_CELLS = 2  # number of cells on each side of the middle cell of a window
MIN_READINGS = 3  # smallest number of readings in the window of a wall
# Smallest number of readings of a corner, in a window without a straight wall
CORNER_READINGS = 2 * MIN_READINGS
THICKNESS_RATIO = 0.4  # largest thickness of a wall segment, as a fraction of the window
# Largest gap between neighbouring readings of a wall that are joined, as a fraction of the window
GAP_RATIO = 0.8
OUTLIER_SIGMAS = 3.0  # a reading farther from its line belongs to something else
# Beams clear cells up to the sum of these two distances before their wall
CLEAR_M, CLEAR_CELLS = 0.015, 1.0
MIN_INCIDENCE = 0.1  # smallest sine of the angle between beam and wall that is used
# Smallest cosine of the angle between the normals of neighbouring readings of one wall
SAME_WALL_COSINE = 0.9
JOIN_STEP_CELLS = 0.5  # distance between the points that join two readings
CROSSED_WEIGHT = 0.35  # evidence of a beam through a cell, relative to a reading in the cell
READING_LOG_ODDS = 0.85  # log-odds that a reading adds to its cell
# Limits of the log-odds: of an occupied cell from below, of a crossed cell from above, of any cell to both sides
MIN_OCCUPIED_LOG_ODDS, MAX_CROSSED_LOG_ODDS, MAX_LOG_ODDS = 1.0, -1.5, 6.0


class SurfacePoints(NamedTuple):
    """The end points of n readings, moved onto their walls.

    points: End points `(n, 2)` (m, map frame), on their wall if there is one.
    normals: Unit normals of the walls `(n, 2)`, NaN without a wall.
    is_wall: Mask `(n,)` of the readings that are drawn as wall.
    """

    points: Floats
    normals: Floats
    is_wall: Flags


def draw_surfaces(
    stops: Sequence[Stop], poses: Floats, noise: RangeNoise, resolution_m: float, memory_limit_mb: float
) -> OccupancyGrid:
    """The map for the `poses` `(s, 3)` of the stops: probability of occupancy, NaN where no beam passed."""
    window_m = window_of(scans_of(stops))
    readings = StackedReadings.of(stops)
    origins = _origins(stops, poses)
    surfaces = on_surfaces(readings, poses, window_m, noise, memory_limit_mb)
    points, normals, is_wall = surfaces
    grid = GrowingGrid(resolution_m, memory_limit_mb)
    grid.cover(np.concatenate([origins, points]))
    crossed = np.zeros_like(grid.values)
    kept = ~np.isnan(normals[:, 0]) | (readings.bel == 1.0)
    cleared = _cleared_to(origins, points, normals, resolution_m)[kept]
    corner = grid.corner[::-1]
    count_crossed(crossed, origins[kept] / resolution_m - corner, cleared / resolution_m - corner)
    joins = _joins(readings, stops, surfaces, GAP_RATIO * window_m, resolution_m)
    hits = _count_points(grid, points[is_wall])
    drawn = _count_points(grid, np.concatenate([points[is_wall], joins])) > 0
    evidence = READING_LOG_ODDS * (_pooled(hits) - CROSSED_WEIGHT * crossed)
    occupied = drawn & (evidence > 0.0)
    log_odds = np.where(
        occupied,
        np.clip(evidence, MIN_OCCUPIED_LOG_ODDS, MAX_LOG_ODDS),
        -np.clip(READING_LOG_ODDS * crossed, 0.0, MAX_LOG_ODDS),
    )
    log_odds = np.where(~occupied & (crossed > 0), np.minimum(log_odds, MAX_CROSSED_LOG_ODDS), log_odds)
    probability = np.where(occupied | (crossed > 0), 1.0 / (1.0 + np.exp(-log_odds)), np.nan)
    return OccupancyGrid(probability.astype(np.float32), grid.geometry)


def on_surfaces(
    readings: StackedReadings, poses: Floats, window_m: float, noise: RangeNoise, memory_limit_mb: float
) -> SurfacePoints:
    """The readings at the `poses` `(s, 3)` of the stops, moved onto wall segments fitted in windows of `window_m` (m)."""
    points = readings.in_map(poses)
    moments = WallMoments(window_m / (2 * WINDOW_CELLS + 1), memory_limit_mb)
    if len(points):
        along_beam, _ = noise.variances(readings.ranges_m)
        moments.add(points, readings.bel / along_beam)
    lines = moments.lines(points, WINDOW_CELLS)
    is_straight = lines.are_walls(MIN_READINGS, THICKNESS_RATIO * window_m)
    offset = np.where(is_straight, lines.offsets(points), 0.0)
    normals = np.where(is_straight[:, None], lines.normals, np.nan)
    std = np.sqrt(readings.variances(np.nan_to_num(normals), poses, noise) + lines.across_m**2)
    is_inlier = np.abs(offset) < OUTLIER_SIGMAS * std
    is_corner = ~is_straight & (lines.count >= CORNER_READINGS)
    shift = np.where((is_straight & is_inlier)[:, None], offset[:, None] * lines.normals, 0.0)
    return SurfacePoints(points - shift, normals, np.asarray((is_straight & is_inlier) | is_corner))


def _origins(stops: Sequence[Stop], poses: Floats) -> Floats:
    """Origins of the beams in the map `(n, 2)`."""
    parts = [
        se2.transform_points(poses[k], stop.readings.origins)
        for k, stop in enumerate(stops)
        if stop.readings is not None
    ]
    return np.concatenate([np.zeros((0, 2)), *parts])


def _cleared_to(origins: Floats, points: Floats, normals: Floats, resolution_m: float) -> Floats:
    """Points `(n, 2)` up to which the beams clear cells: before their wall, farther from it at grazing incidence."""
    beams = points - origins
    length = np.hypot(beams[:, 0], beams[:, 1])
    direction = beams / np.maximum(length, 1e-9)[:, None]
    incidence = np.maximum(np.abs(np.sum(direction * normals, axis=1)), MIN_INCIDENCE)
    incidence = np.where(np.isnan(incidence), MIN_INCIDENCE, incidence)
    margin = (CLEAR_M + CLEAR_CELLS * resolution_m) / incidence
    cleared_m = np.maximum(length - margin, 0.0)
    return np.asarray(origins + direction * cleared_m[:, None])


def _joins(
    readings: StackedReadings,
    stops: Sequence[Stop],
    surfaces: SurfacePoints,
    max_gap_m: float,
    resolution_m: float,
) -> Floats:
    """Points `(k, 2)` between neighbouring readings of one sweep that lie on the same wall."""
    points, normals, is_wall = surfaces
    scanned = [
        (stop.scan, stop.readings) for stop in stops if stop.scan is not None and stop.readings is not None
    ]
    index = np.concatenate([np.zeros(0, np.int64), *(used.index for _, used in scanned)])
    sensor = np.concatenate([np.zeros(0, np.int64), *(scan.sensor[used.index] for scan, used in scanned)])
    are_neighbours = (np.diff(readings.stop) == 0) & (np.diff(sensor) == 0) & (np.diff(index) <= 2)
    with np.errstate(invalid="ignore"):
        same = np.abs(np.sum(normals[1:] * normals[:-1], axis=1)) > SAME_WALL_COSINE  # False beside NaN
    gap = np.diff(points, axis=0)
    length = np.hypot(gap[:, 0], gap[:, 1])
    step_m = JOIN_STEP_CELLS * resolution_m
    pairs = np.flatnonzero(
        are_neighbours & same & is_wall[1:] & is_wall[:-1] & (length < max_gap_m) & (length > step_m)
    )
    steps = np.ceil(length[pairs] / step_m).astype(np.int64)
    which = np.repeat(pairs, steps)
    order = np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)
    fraction = (order + 1) / np.repeat(steps + 1, steps)
    return np.asarray(points[which] + fraction[:, None] * gap[which])


def _count_points(grid: GrowingGrid, points: Floats) -> Floats:
    """Number of points in each cell of the grid."""
    cells = grid.cells(points)
    counts = np.zeros_like(grid.values)
    np.add.at(counts, (cells[:, 0], cells[:, 1]), 1.0)
    return counts


def _pooled(counts: Floats) -> Floats:
    """Sums over 3 x 3 cells."""
    padded = np.pad(counts, 1)
    rows, cols = counts.shape
    return np.asarray(sum(padded[i : i + rows, j : j + cols] for i in range(3) for j in range(3)))
