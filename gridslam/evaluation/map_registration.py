"""Aligns a built map with the true one by their walls, when no trajectory relates their frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.map_errors import wall_points
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]
YAW_STEP_DEG = 2.0
MAX_COARSE_CELLS = 160  # across the larger map
MIN_COARSE_M = 0.1
MAX_POINTS = 4000  # wall points that are used, evenly spaced
CANDIDATES = 6  # coarse poses that are refined
TRIM_M = (1.5, 0.8, 0.4, 0.2, 0.1)  # largest distances of correspondences, one after the other
ITERATIONS, LAST_ITERATIONS = 12, 40  # number of iterations from each start, and finally from the best pose
NUDGE_CELLS = 1.5  # cells of two maps interlock: the last step starts from poses this far around the best one
INLIER_M = 0.15  # a wall point this near to a true wall agrees with it
MIN_INLIER_RATIO = 0.5
AMBIGUOUS_RATIO, DISTINCT_M, DISTINCT_RAD = 0.97, 0.5, 0.2


@dataclass(frozen=True, slots=True)
class MapRegistration:
    """`T_truth_map` (x, y, yaw); fraction of mapped wall points near true walls; whether another pose fits as well."""

    T_truth_map: Floats
    inlier_ratio: float
    is_ambiguous: bool

    @property
    def is_reliable(self) -> bool:
        """Whether enough wall points agree."""
        return self.inlier_ratio >= MIN_INLIER_RATIO


def register_maps(built: OccupancyGrid, truth: OccupancyGrid) -> MapRegistration | None:
    """The pose of the built map in the truth's frame under which their walls agree best; None if a map has no wall.

    Correlation of the walls over all yaw angles and shifts gives candidates; iterative closest points refine them.
    """
    points, walls = thinned(wall_points(built)), wall_points(truth)
    if not len(points) or not len(walls):
        return None
    from scipy.spatial import cKDTree

    tree = cKDTree(walls)
    found = [
        refined(start, points, walls=walls, tree=tree, trims_m=TRIM_M, iterations=ITERATIONS)
        for start in _coarse_candidates(points, walls)
    ]
    scores = [_agreement(pose, points, tree) for pose in found]
    best = found[int(np.argmax(scores))]
    pose = finely_refined(best, points, walls=walls, tree=tree, cell_m=truth.geometry.resolution_m)
    rivals = [
        score
        for other, score in zip(found, scores, strict=True)
        if _is_distinct(other, best) and score >= AMBIGUOUS_RATIO * max(scores)
    ]
    distances, _ = tree.query(se2.transform_points(pose, points))
    return MapRegistration(pose, float((distances <= INLIER_M).mean()), bool(rivals))


def finely_refined(pose: Floats, points: Floats, walls: Floats, tree: Any, cell_m: float) -> Floats:
    """The best pose `(3,)` around one that is right to a cell or two."""
    shift = NUDGE_CELLS * cell_m
    starts = [pose + np.array([shift * i, shift * j, 0.0]) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    found = [
        refined(start, points, walls=walls, tree=tree, trims_m=TRIM_M[-1:], iterations=LAST_ITERATIONS)
        for start in starts
    ]
    return max(found, key=lambda one: _agreement(one, points, tree))


def thinned(points: Floats) -> Floats:
    """At most `MAX_POINTS` of the points, evenly spaced."""
    step = max(-(-len(points) // MAX_POINTS), 1)
    return points[::step]


def _coarse_candidates(points: Floats, walls: Floats) -> list[Floats]:
    """Poses with the highest correlations of the walls, one for each of the best yaw angles."""
    from scipy.ndimage import gaussian_filter

    centre = points.mean(axis=0)
    radius = float(np.hypot(*(points - centre).T).max())
    low, high = walls.min(axis=0), walls.max(axis=0)
    cell = max(float(max(2.0 * radius, *(high - low))) / MAX_COARSE_CELLS, MIN_COARSE_M)
    shape = tuple(int(np.ceil((extent + 2.0 * radius) / cell)) + 4 for extent in (high - low).tolist())
    target = gaussian_filter(histogram(walls - low + radius, cell, shape), 1.0)
    spectrum = np.fft.rfft2(target)
    scored: list[tuple[float, Floats]] = []
    for yaw in np.radians(np.arange(0.0, 360.0, YAW_STEP_DEG)).tolist():
        rotated = se2.transform_points(np.array([0.0, 0.0, yaw]), points - centre) + radius
        image = histogram(rotated, cell, shape)
        correlation = np.fft.irfft2(spectrum * np.conj(np.fft.rfft2(image)), s=shape)
        index = int(np.argmax(correlation))
        shift = np.array(np.unravel_index(index, shape), np.float64)
        shift = np.where(shift > np.array(shape) / 2, shift - np.array(shape), shift) * cell
        position = shift + low - se2.transform_points(np.array([0.0, 0.0, yaw]), centre[None])[0]
        scored.append((float(correlation.flat[index]), np.array([*position, float(se2.wrap_angle(yaw))])))
    scored.sort(key=lambda item: -item[0])
    chosen: list[Floats] = []
    for _, pose in scored:
        if all(abs(float(se2.wrap_angle(pose[2] - other[2]))) > DISTINCT_RAD for other in chosen):
            chosen.append(pose)
        if len(chosen) == CANDIDATES:
            break
    return chosen


def histogram(points: Floats, cell: float, shape: tuple[int, ...]) -> Floats:
    """1 in the cells that hold a point, `shape` in x and y."""
    image = np.zeros(shape)
    index = np.clip((points / cell).astype(np.int64), 0, np.array(shape) - 1)
    image[index[:, 0], index[:, 1]] = 1.0
    return image


def refined(
    pose: Floats, points: Floats, walls: Floats, tree: Any, trims_m: Sequence[float], iterations: int
) -> Floats:
    """Iterative closest points with correspondences trimmed to smaller and smaller distances."""
    for limit in trims_m:
        for _ in range(iterations):
            moved = se2.transform_points(pose, points)
            distances, index = tree.query(moved, distance_upper_bound=limit)
            near = np.isfinite(distances)
            if np.count_nonzero(near) < 3:
                return pose
            pairs = (np.pad(points[near], ((0, 0), (0, 1))), np.pad(walls[index[near]], ((0, 0), (0, 1))))
            found = find_alignment(*pairs, "se2")
            if found is None:
                return pose
            step = se2.between(pose, found.T_truth_estimate)
            pose = found.T_truth_estimate
            if np.hypot(step[0], step[1]) < 1e-5 and abs(step[2]) < 1e-6:
                break
    return pose


def _agreement(pose: Floats, points: Floats, tree: Any) -> float:
    """Mean agreement of the wall points: 1 on a true wall, 0 from INLIER_M on."""
    distances, _ = tree.query(se2.transform_points(pose, points), distance_upper_bound=INLIER_M)
    return float((1.0 - np.minimum(distances, INLIER_M) / INLIER_M).mean())


def _is_distinct(pose: Floats, other: Floats) -> bool:
    step = se2.between(pose, other)
    return bool(np.hypot(step[0], step[1]) > DISTINCT_M or abs(step[2]) > DISTINCT_RAD)
