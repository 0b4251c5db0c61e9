"""Lays two maps on each other that overlap in part: walls lie on walls, and none in what the other map knows to be free.

Walls alone are not enough: two maps of rooms and corridors have many poses in which half of the walls of one lie on walls of the
other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.evaluation.map_errors import wall_points
from gridslam.evaluation.map_registration import (
    DISTINCT_RAD,
    INLIER_M,
    ITERATIONS,
    TRIM_M,
    YAW_STEP_DEG,
    finely_refined,
    histogram,
    refined,
    thinned,
)
from gridslam.maps.editing import FREE_UP_TO
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MAX_COARSE_CELLS, MIN_COARSE_M = 300, 0.1  # across the larger map
FREE_WEIGHT = 0.4  # weight of a wall in free space in the coarse search; one on a wall has about 1
# Coarse poses that are refined, at least `PEAK_M` from each other, and peaks of the correlation at each yaw angle
CANDIDATES, PEAKS_PER_YAW, PEAK_M = 12, 3, 1.0
START_TRIMS_M = TRIM_M[2:]
CLEAR_M = 0.3  # a wall point in free space contradicts the other map if none of its walls is this near
CONTRADICTED_WEIGHT = (
    2.0  # weight of a contradicted point in the score of a pose; one that agrees has 1 at most
)
# Right poses had 0.013 to 0.029 with a fifth of the furniture moved, wrong ones 0.066 and more
MAX_CONTRADICTED_RATIO = 0.045
MIN_LEAD = 1.2  # smallest ratio of the score to that of the next pose


@dataclass(frozen=True, slots=True)
class MapOverlap:
    """`T_base_other` (3,), the ratio of walls that lie in free space of the other map to all in its known space, and the lead.

    The lead is the ratio of the pose's score to that of the best other one.
    """

    T_base_other: Floats
    contradicted_ratio: float
    lead: float

    @property
    def is_reliable(self) -> bool:
        """Whether the pose is hardly contradicted, and no other one is nearly as good."""
        return self.contradicted_ratio <= MAX_CONTRADICTED_RATIO and self.lead >= MIN_LEAD


@dataclass(frozen=True, slots=True)
class _Side:
    """A map with all its wall points, a search tree of them, and some of them, each of which stands for `weight` points."""

    grid: OccupancyGrid
    walls: Floats
    tree: Any
    points: Floats
    weight: float

    @staticmethod
    def of(grid: OccupancyGrid) -> _Side:
        from scipy.spatial import cKDTree

        walls = wall_points(grid)
        points = thinned(walls)
        return _Side(grid, walls, cKDTree(walls), points, len(walls) / max(len(points), 1))

    def is_free_at(self, points: Floats) -> Bools:
        """Whether points `(n, 2)` lie in free cells."""
        cells, shape = self.grid.geometry.cells(points), np.array(self.grid.probability.shape)
        is_inside = ((cells >= 0) & (cells < shape)).all(axis=1)
        is_free = np.zeros(len(points), np.bool_)
        is_free[is_inside] = self.grid.probability[tuple(cells[is_inside].T)] <= FREE_UP_TO
        return is_free

    def free_points(self, spacing_m: float) -> Floats:
        """Centres `(n, 2)` of free cells, about a spacing apart."""
        step = max(int(spacing_m / self.grid.geometry.resolution_m), 1)
        return self.grid.geometry.centres(
            step * np.argwhere(self.grid.probability[::step, ::step] <= FREE_UP_TO)
        )


def register_overlapping(other: OccupancyGrid, base: OccupancyGrid) -> MapOverlap | None:
    """The pose of a map in another one by the walls and the free space of both; None if one has no wall or no free cell."""
    one, two = _Side.of(base), _Side.of(other)
    if not (len(one.walls) and len(two.walls)):
        return None
    found = [
        refined(
            start, two.points, walls=one.walls, tree=one.tree, trims_m=START_TRIMS_M, iterations=ITERATIONS
        )
        for start in _coarse_poses(one, two)
    ]
    if not found:
        return None
    scores = [_evidence(pose, one, two)[0] for pose in found]
    best = int(np.argmax(scores))
    rivals = [s for pose, s in zip(found, scores, strict=True) if _is_elsewhere(pose, found[best], two)]
    pose = finely_refined(
        found[best], two.points, walls=one.walls, tree=one.tree, cell_m=base.geometry.resolution_m
    )
    score, ratio = _evidence(pose, one, two)
    return MapOverlap(pose, ratio, max(score, 0.0) / max([1.0, *rivals]))


def _evidence(pose: Floats, one: _Side, two: _Side) -> tuple[float, float]:
    """Score of the pose of the second map in the first, and the ratio of walls in free space to those on walls or there."""
    agreement = agreeing = contradicted = 0.0
    for T_map_points, target, source in ((pose, one, two), (np.asarray(se2.inverse(pose)), two, one)):
        moved = se2.transform_points(T_map_points, source.points)
        distance_m, _ = target.tree.query(moved, distance_upper_bound=CLEAR_M)
        agreement += source.weight * float((1.0 - np.minimum(distance_m, INLIER_M) / INLIER_M).sum())
        agreeing += source.weight * float((distance_m <= INLIER_M).sum())
        contradicted += source.weight * float((target.is_free_at(moved) & ~np.isfinite(distance_m)).sum())
    ratio = contradicted / max(agreeing + contradicted, 1.0)
    return agreement - CONTRADICTED_WEIGHT * contradicted, ratio


def _coarse_poses(one: _Side, two: _Side) -> list[Floats]:
    """Poses of the second map in the first with most walls on walls, and fewest in free space, each in a place of its own."""
    ranked = sorted(_correlated(one, two), key=lambda item: -item[0])
    chosen: list[Floats] = []
    for _, pose in ranked:
        if all(_is_elsewhere(pose, kept, two) for kept in chosen):
            chosen.append(pose)
        if len(chosen) == CANDIDATES:
            break
    return chosen


def _correlated(one: _Side, two: _Side) -> Iterator[tuple[float, Floats]]:
    """Scores and poses of the peaks of the correlation at every yaw angle."""
    from scipy.ndimage import binary_dilation, gaussian_filter

    centre = two.points.mean(axis=0)
    radius = float(np.hypot(*(two.points - centre).T).max())
    low, high = one.walls.min(axis=0), one.walls.max(axis=0)
    cell = max(float(max(2.0 * radius, *(high - low))) / MAX_COARSE_CELLS, MIN_COARSE_M)
    shape = tuple(int(np.ceil((extent + 2.0 * radius) / cell)) + 4 for extent in (high - low).tolist())
    walls = histogram(one.walls - low + radius, cell, shape)
    free = histogram(one.free_points(cell) - low + radius, cell, shape)
    is_near_wall = binary_dilation(walls > 0.0)
    target = gaussian_filter(walls, 1.0) - FREE_WEIGHT * np.where(is_near_wall, 0.0, free)
    spectrum = np.fft.rfft2(target)
    around = np.arange(-int(PEAK_M / cell) - 1, int(PEAK_M / cell) + 2)
    for yaw in np.radians(np.arange(0.0, 360.0, YAW_STEP_DEG)).tolist():
        turned = np.array([0.0, 0.0, yaw])
        image = histogram(se2.transform_points(turned, two.points - centre) + radius, cell, shape)
        correlation = np.fft.irfft2(spectrum * np.conj(np.fft.rfft2(image)), s=shape)
        for _ in range(PEAKS_PER_YAW):
            peak = np.array(np.unravel_index(int(np.argmax(correlation)), shape))
            shift = np.where(peak > np.array(shape) / 2, peak - np.array(shape), peak) * cell
            position = shift + low - se2.transform_points(turned, centre[None])[0]
            yield float(correlation[tuple(peak)]), np.array([*position, float(se2.wrap_angle(yaw))])
            rows, cols = ((at + around) % size for at, size in zip(peak, shape, strict=True))
            correlation[np.ix_(rows, cols)] = -np.inf


def _is_elsewhere(pose: Floats, kept: Floats, side: _Side) -> bool:
    """Whether two poses put the middle of a map in different places, or turn it differently."""
    centre = side.points.mean(axis=0)[None]
    away = se2.transform_points(pose, centre) - se2.transform_points(kept, centre)
    return bool(np.hypot(*away[0]) > PEAK_M or abs(float(se2.wrap_angle(pose[2] - kept[2]))) > DISTINCT_RAD)
