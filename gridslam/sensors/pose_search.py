"""Global pose search: the poses on a whole map that explain a set of points, by exhaustive search and refinement.

Monte Carlo localization uses it as a proposal when it starts without a pose and when it is lost: poses are drawn from the
measurement instead of the motion (the dual of Monte Carlo localization, Thrun et al. 2001).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.likelihood_field import sum_over_offsets
from gridslam.sensors.likelihood_field import DistanceField, Table

Floats = NDArray[np.float64]


_CLIMB_POINTS = 100  # by which a pose climbs to its maximum; all points score it there


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
        nearest = _block_reduce(field.steps, self._block, np.minimum, 255)
        distances = field.distances_m[nearest]
        scores = np.rint(255.0 * np.exp(-0.5 * (distances / settings.sigma_m) ** 2)).astype(np.uint8)
        scores[nearest == 255] = 0
        self._coarse_scores = scores
        self._positions = self._candidate_positions(free)

    def search(self, points: Floats, table: Table) -> PoseHypotheses:
        """Poses that explain points `(m, 2)` in the robot's frame best, scored by the table of the distance field."""
        settings = self._settings
        coarse = points if len(points) <= settings.points else points[_evenly(len(points), settings.points)]
        return self.refine(self._coarse_poses(coarse), points, table)

    def refine(self, poses: Floats, points: Floats, table: Table) -> PoseHypotheses:
        """The local maxima of the score near the given poses `(n, 3)`, one for each bin."""
        settings = self._settings
        step_m, step_rad = 0.5 * self._cell_m, np.pi / settings.headings
        few = points[_evenly(len(points), min(len(points), _CLIMB_POINTS))]
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
        clearance_steps = self._field.steps.astype(np.uint16)
        clearance_steps += 1
        clearance_steps *= free
        clearance = _block_reduce(clearance_steps, self._block, np.maximum, 0)
        stride = max(round(settings.spacing_m / self._cell_m), 1)
        while True:
            positions = _widest_cells(clearance, stride)
            if len(positions) * settings.headings <= settings.max_poses or stride >= max(clearance.shape):
                return positions
            stride += 1


def _block_reduce(
    values: NDArray[np.generic], block: int, reduce: np.ufunc, fill: int
) -> NDArray[np.generic]:
    """Values `(rows, cols)` reduced over blocks of `block` by `block` cells; incomplete blocks are padded with `fill`."""
    rows, cols = (-(-n // block) for n in values.shape)
    full = values
    if values.shape != (rows * block, cols * block):
        full = np.full((rows * block, cols * block), fill, values.dtype)
        full[: values.shape[0], : values.shape[1]] = values
    blocks = full.reshape(rows, block, cols, block)
    return np.asarray(reduce.reduce(reduce.reduce(blocks, axis=3), axis=1))


def _widest_cells(clearance: NDArray[np.generic], stride: int) -> NDArray[np.int64]:
    """Cells `(n, 2)`: of every square of `stride` cells the one with the largest clearance, unless all are 0."""
    rows, cols = (-(-n // stride) for n in clearance.shape)
    full = np.zeros((rows * stride, cols * stride), np.int64)
    full[: clearance.shape[0], : clearance.shape[1]] = clearance
    squares = full.reshape(rows, stride, cols, stride).transpose(0, 2, 1, 3).reshape(rows, cols, -1)
    inside = squares.argmax(axis=2)
    row, col = np.nonzero(squares.max(axis=2) > 0)
    chosen = inside[row, col]
    return np.column_stack([row * stride + chosen // stride, col * stride + chosen % stride])


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


def _evenly(n: int, count: int) -> NDArray[np.int64]:
    return (np.arange(count) * n) // count
