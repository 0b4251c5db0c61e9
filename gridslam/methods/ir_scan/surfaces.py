"""The finished map of the best settings: readings averaged to pieces of wall, and cleared where beams pass.

A single reading is uncertain by several cells. The readings of all stops in a window make a line, onto which each of them is
drawn; where too few agree, or beams of other stops go through, there is no wall.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared import count_crossed
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ir_scan.adjustment import Readings
from gridslam.methods.ir_scan.config import DrawingConfig
from gridslam.methods.ir_scan.lines import WallSums
from gridslam.methods.ir_scan.scale import scans_of, window_of
from gridslam.methods.ir_scan.stops import Place
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_WINDOW_CELLS = 2  # to each side
_THICKNESS = 0.4  # of a straight piece of wall, as a share of the window
_GAP = 0.8  # neighbouring readings of one wall are joined over this share of the window
_SIGMAS = 3.0  # a reading farther from its line belongs to something else
_CLEAR_M = 0.015  # beams clear cells up to this distance before their wall
_CLEAR_CELLS = 1.0
_READING = 0.85  # log-odds of a reading in a cell
_LIMIT = 6.0


def draw_surfaces(
    places: Sequence[Place],
    poses: Floats,
    config: DrawingConfig,
    noise: RangeNoise,
    resolution_m: float,
    memory_limit_mb: float,
) -> OccupancyGrid:
    """The map under poses of the places `(p, 3)`: probability, NaN where no beam went."""
    window_m = config.window_m or window_of(scans_of(places))
    gap_m = _GAP * window_m if config.gap_m is None else config.gap_m
    readings = Readings.of(places)
    starts = _starts(places, poses)
    points, normals, is_wall = on_surfaces(
        readings, poses, window_m, config.least_readings, noise, memory_limit_mb
    )
    grid = GrowingGrid(resolution_m, memory_limit_mb)
    grid.cover(np.concatenate([starts, points]))
    crossed = np.zeros_like(grid.values)
    kept = ~np.isnan(normals[:, 0]) | (readings.bel == 1.0)
    ends = _cleared_to(starts, points, normals, resolution_m)[kept]
    corner = grid.corner[::-1]
    count_crossed(crossed, starts[kept] / resolution_m - corner, ends / resolution_m - corner)
    walls = np.concatenate(
        [points[is_wall], _joined(readings, places, points, normals, is_wall, gap_m, resolution_m)]
    )
    hits = _counted(grid, points[is_wall])
    drawn = _counted(grid, walls) > 0
    evidence = _READING * (_pooled(hits) - config.crossed_weight * crossed)
    occupied = drawn & (evidence > 0.0)
    log_odds = np.where(occupied, np.clip(evidence, 1.0, _LIMIT), -np.clip(_READING * crossed, 0.0, _LIMIT))
    log_odds = np.where(~occupied & (crossed > 0), np.minimum(log_odds, -1.5), log_odds)
    probability = np.where(occupied | (crossed > 0), 1.0 / (1.0 + np.exp(-log_odds)), np.nan)
    return OccupancyGrid(probability.astype(np.float32), grid.geometry)


def on_surfaces(
    readings: Readings,
    poses: Floats,
    window_m: float,
    least_readings: int,
    noise: RangeNoise,
    memory_limit_mb: float,
) -> tuple[Floats, Floats, Flags]:
    """End points `(n, 2)` drawn onto their walls, the walls' normals (NaN without a wall nearby), and which points are walls."""
    points = readings.in_map(poses)
    sums = WallSums(window_m / (2 * _WINDOW_CELLS + 1), memory_limit_mb)
    if len(points):
        sums.add(points, readings.bel / noise.variances(readings.ranges_m)[0])
    lines = sums.lines(points, _WINDOW_CELLS)
    is_straight = lines.are_walls(least_readings, _THICKNESS * window_m)
    off = np.where(is_straight, lines.offsets(points), 0.0)
    normals = np.where(is_straight[:, None], lines.normals, np.nan)
    deviation = np.sqrt(readings.variances(np.nan_to_num(normals), poses, noise) + lines.across_m**2)
    near = np.abs(off) < _SIGMAS * deviation
    is_corner = ~is_straight & (lines.count >= 2 * least_readings)
    shift = np.where((is_straight & near)[:, None], off[:, None] * lines.normals, 0.0)
    return points - shift, normals, np.asarray((is_straight & near) | is_corner)


def _starts(places: Sequence[Place], poses: Floats) -> Floats:
    """Where the beams begin in the map `(n, 2)`."""
    parts = [
        se2.transform_points(poses[k], place.ends.origins)
        for k, place in enumerate(places)
        if place.ends is not None
    ]
    return np.concatenate([np.zeros((0, 2)), *parts])


def _cleared_to(starts: Floats, points: Floats, normals: Floats, resolution_m: float) -> Floats:
    """Up to where each beam clears cells: away from its wall, the more the flatter it meets it."""
    way = points - starts
    length = np.hypot(way[:, 0], way[:, 1])
    direction = way / np.maximum(length, 1e-9)[:, None]
    steep = np.maximum(np.abs(np.sum(direction * normals, axis=1)), 0.1)
    back = (_CLEAR_M + _CLEAR_CELLS * resolution_m) / np.where(np.isnan(steep), 0.1, steep)
    reached = np.maximum(length - back, 0.0)
    return np.asarray(starts + direction * reached[:, None])


def _joined(
    readings: Readings,
    places: Sequence[Place],
    points: Floats,
    normals: Floats,
    is_wall: Flags,
    gap_m: float,
    resolution_m: float,
) -> Floats:
    """Points between neighbouring readings of one sweep that lie on the same wall."""
    index = np.concatenate(
        [np.zeros(0, np.int64), *(place.ends.index for place in places if place.ends is not None)]
    )
    sensor = np.concatenate(
        [
            np.zeros(0, np.int64),
            *(p.scan.sensor[p.ends.index] for p in places if p.ends is not None and p.scan is not None),
        ]
    )
    beside = (np.diff(readings.place) == 0) & (np.diff(sensor) == 0) & (np.diff(index) <= 2)
    with np.errstate(invalid="ignore"):
        same = np.abs(np.sum(normals[1:] * normals[:-1], axis=1)) > 0.9  # False beside NaN
    way = np.diff(points, axis=0)
    length = np.hypot(way[:, 0], way[:, 1])
    pairs = np.flatnonzero(
        beside & same & is_wall[1:] & is_wall[:-1] & (length < gap_m) & (length > 0.5 * resolution_m)
    )
    steps = np.ceil(length[pairs] / (0.5 * resolution_m)).astype(np.int64)
    which = np.repeat(pairs, steps)
    order = np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)
    share = (order + 1) / np.repeat(steps + 1, steps)
    return np.asarray(points[which] + share[:, None] * way[which])


def _counted(grid: GrowingGrid, points: Floats) -> Floats:
    """Number of points in each cell."""
    cells = grid.cells(points)
    counts = np.zeros_like(grid.values)
    np.add.at(counts, (cells[:, 0], cells[:, 1]), 1.0)
    return counts


def _pooled(counts: Floats) -> Floats:
    """Sums over 3 x 3 cells."""
    padded = np.pad(counts, 1)
    rows, cols = counts.shape
    return np.asarray(sum(padded[i : i + rows, j : j + cols] for i in range(3) for j in range(3)))
