"""Global pose search: the poses on a whole map that explain a set of points, by exhaustive search and refinement.

Monte Carlo localization uses it as a proposal when it starts without a pose and when it is lost: poses are drawn from the
measurement instead of the motion (the dual of Monte Carlo localization, Thrun et al. 2001).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.kernels.localization.likelihood_field import sum_over_offsets
from gridslam.sensors.likelihood_field import FAR, DistanceField, Table

Floats = NDArray[np.float64]

CELLS_AT_ONCE = 1 << 20  # number of cells of a large map that are processed together
_CLIMB_POINTS = 100  # number of points by which a pose climbs to its maximum; all points score it there


@dataclass(frozen=True, slots=True)
class PoseSearchSettings:
    """Resolution of the search."""

    spacing_m: float  # distance between the positions of the exhaustive stage
    headings: int  # number of headings at each position
    sigma_m: float  # standard deviation of the likelihood in the exhaustive stage
    points: int  # number of points that the exhaustive stage uses
    max_poses: int  # largest number of poses of the exhaustive stage; on larger maps the spacing grows
    refined: int  # number of poses that are refined
    hypotheses: int  # largest number of hypotheses in the result
    bin_m: float  # the result has one hypothesis for each bin of position
    bin_rad: float  # and heading


@dataclass(frozen=True, slots=True)
class PoseHypotheses:
    """Poses `(k, 3)` with their log-likelihoods `(k,)`, best first, at most one in a bin of position and heading."""

    poses: Floats
    scores: Floats


class PoseSearch:
    """Global search on one map; the coarse field and the candidate positions are computed once."""

    def __init__(self, field: DistanceField, free: NDArray[np.bool_], settings: PoseSearchSettings) -> None:
        self._field = field
        self._settings = settings
        step = field.geometry.resolution_m
        self._block = max(round(0.5 * settings.sigma_m / step), 1)
        self._cell_m = self._block * step
        nearest = _block_reduce(
            lambda rows: field.steps[rows], field.steps.shape, self._block, np.minimum, FAR
        )
        scores = np.rint(255.0 * np.exp(-0.5 * (field.distances_m / settings.sigma_m) ** 2)).astype(np.uint8)
        scores[FAR] = 0
        self._coarse_scores = scores[nearest]
        self._positions = self._candidate_positions(free)

    def search(self, points: Floats, table: Table) -> PoseHypotheses:
        """Poses that explain points `(m, 2)` in the robot's frame best, scored by the table of the distance field."""
        settings = self._settings
        coarse = points[evenly_spaced(len(points), settings.points)]
        return self.refine(self._coarse_poses(coarse), points, table)

    def refine(self, poses: Floats, points: Floats, table: Table) -> PoseHypotheses:
        """The local maxima of the score near the given poses `(n, 3)`, one for each bin."""
        settings = self._settings
        step_m, step_rad = 0.5 * self._cell_m, np.pi / settings.headings
        few = points[evenly_spaced(len(points), _CLIMB_POINTS)]
        scores = self._field.table_sums(table, few, poses)
        for _ in range(5):
            poses, scores = climb(
                lambda tried: self._field.table_sums(table, few, tried), poses, scores, step_m, step_rad
            )
            poses, scores = best_per_bin(poses, scores, step_m, step_rad, settings.refined)
            step_m, step_rad = 0.6 * step_m, 0.6 * step_rad
        scores = self._field.table_sums(table, points, poses)
        return PoseHypotheses(
            *best_per_bin(poses, scores, settings.bin_m, settings.bin_rad, settings.hypotheses)
        )

    def _coarse_poses(self, points: Floats) -> Floats:
        """The best poses `(k, 3)` of the exhaustive stage."""
        settings = self._settings
        geometry = self._field.geometry
        pad = int(np.ceil(np.hypot(points[:, 0], points[:, 1]).max() / self._cell_m)) + 2
        padded = np.pad(self._coarse_scores, pad)
        width = padded.shape[1]
        headings = np.arange(settings.headings) * (2.0 * np.pi / settings.headings)
        cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
        cols = np.rint((cos * points[:, 0] - sin * points[:, 1]) / self._cell_m).astype(np.int32)
        rows = np.rint((sin * points[:, 0] + cos * points[:, 1]) / self._cell_m).astype(np.int32)
        starts = ((self._positions[:, 0] + pad) * width + self._positions[:, 1] + pad).astype(np.int32)
        scores = sum_over_offsets(padded.ravel(), starts, rows * width + cols).ravel()
        keep = min(settings.refined, len(scores))
        # argpartition orders equal scores arbitrarily: take all above the threshold, then the first ones at the threshold.
        threshold = np.partition(scores, len(scores) - keep)[len(scores) - keep]
        above = np.flatnonzero(scores > threshold)
        chosen = np.r_[above, np.flatnonzero(scores == threshold)[: keep - len(above)]]
        cells = self._positions[chosen % len(starts)]
        local = (cells[:, ::-1] + 0.5) * self._cell_m
        yaw = geometry.yaw_rad
        origin = np.array([*geometry.origin_xy_m, yaw])
        return se2.compose(origin, np.column_stack([local, headings[chosen // len(starts)]]))

    def _candidate_positions(self, free: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Coarse cells `(n, 2)`: for every square of the spacing with free cells the cell farthest from walls."""
        settings = self._settings
        steps = self._field.steps
        clearance = _block_reduce(
            lambda rows: (steps[rows].astype(np.int16) + 1) * free[rows],
            steps.shape,
            self._block,
            np.maximum,
            0,
        )
        is_free = clearance > 0
        max_positions = settings.max_poses / settings.headings
        needed = math.sqrt(np.count_nonzero(is_free) / max_positions)  # squares of fewer cells are too many
        stride = max(round(settings.spacing_m / self._cell_m), math.ceil(needed), 1)
        while np.count_nonzero(_in_squares(is_free, stride)) > max_positions and stride < max(is_free.shape):
            stride += 1
        return _widest_cells(clearance, stride)


def _block_reduce(
    part: Callable[[slice], NDArray[Any]],
    shape: tuple[int, int],
    block: int,
    reduce: np.ufunc,
    fill: int,
) -> NDArray[Any]:
    """Values `(rows, cols)`, of which `part` returns those of some rows, reduced over blocks of `block` by `block` cells.

    Incomplete blocks are padded with `fill`. Of a large map a few blocks of rows are taken at once.
    """
    cols = -(-shape[1] // block)
    band = block * max(CELLS_AT_ONCE // (block * max(shape[1], 1)), 1)
    reduced = []
    for first in range(0, shape[0], band):
        values = part(slice(first, first + band))
        full = np.full((-(-len(values) // block) * block, cols * block), fill, values.dtype)
        full[: values.shape[0], : values.shape[1]] = values
        blocks = full.reshape(-1, block, cols, block)
        reduced.append(reduce.reduce(reduce.reduce(blocks, axis=3), axis=1))
    return np.concatenate(reduced)


def _in_squares(values: NDArray[Any], stride: int) -> NDArray[Any]:
    """The largest of the values `(rows, cols)` in every square of `stride` cells; those at the border may be cut."""
    rows, cols = (np.arange(0, size, stride) for size in values.shape)
    return np.asarray(np.maximum.reduceat(np.maximum.reduceat(values, rows, axis=0), cols, axis=1))


def _widest_cells(clearance: NDArray[Any], stride: int) -> NDArray[np.int64]:
    """Cells `(n, 2)`: of every square of `stride` cells the one with the largest clearance, unless all are 0."""
    squares = stride * np.argwhere(_in_squares(clearance, stride) > 0)
    # At the border cells are repeated; the first of several equal ones is chosen, which is none of those.
    rows, cols = (
        np.minimum(squares[:, axis, None] + np.arange(stride), size - 1)
        for axis, size in enumerate(clearance.shape)
    )
    chosen = clearance[rows[:, :, None], cols[:, None, :]].reshape(len(squares), -1).argmax(axis=1)
    return np.asarray(squares + np.column_stack([chosen // stride, chosen % stride]))


def climb(
    score: Callable[[Floats], Floats], poses: Floats, scores: Floats, step_m: float, step_rad: float
) -> tuple[Floats, Floats]:
    """One step of hill climbing: each pose `(n, 3)` moves to the best of its six neighbours along the axes if that is better."""
    steps = np.zeros((6, 3))
    for axis, size in enumerate((step_m, step_m, step_rad)):
        steps[2 * axis, axis], steps[2 * axis + 1, axis] = size, -size
    around = poses[:, None] + steps
    tried = score(around.reshape(-1, 3)).reshape(len(poses), 6)
    choice = tried.argmax(axis=1)
    each = np.arange(len(poses))
    best = tried[each, choice]
    better = best > scores
    return np.where(better[:, None], around[each, choice], poses), np.where(better, best, scores)


def best_per_bin(
    poses: Floats, scores: Floats, bin_m: float, bin_rad: float, max_count: int
) -> tuple[Floats, Floats]:
    """Poses and scores, best first, at most one for every bin of the given size and at most `max_count` in all."""
    order = np.argsort(-scores, kind="stable")
    poses, scores = poses[order], scores[order]
    size = max(int(np.ceil(2.0 * np.pi / bin_rad)), 1)
    yaw = np.floor(np.mod(poses[:, 2], 2.0 * np.pi) / (2.0 * np.pi / size)).astype(np.int64)
    bins = np.floor(poses[:, :2] / bin_m).astype(np.int64)
    col, row = (bins - bins.min(axis=0, initial=0)).T
    _, first = np.unique((row * (col.max(initial=0) + 1) + col) * size + yaw, return_index=True)
    kept = np.sort(first)[:max_count]
    return poses[kept], scores[kept]
