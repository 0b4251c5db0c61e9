"""Where a stop really was: the scan against the map (paper section 2.6), as the paper does it and beyond."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared import add_spots, shifted_changes, shifted_sums
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.ir_scan.config import SearchMatching, ShiftMatching
from gridslam.methods.ir_scan.lines import WallSums
from gridslam.sensors.infrared import BeamEnds, RangeNoise

Floats = NDArray[np.float64]
Verdict = Literal["matched", "first", "too_few_points", "no_match", "ambiguous", "off"]

_SPOT_M = 0.02  # deviation of a reading about its wall in the search
_LEAST_PRIOR = (
    np.array([0.004, 0.004, 0.004]) ** 2
)  # what is never known better before a match, m^2, m^2, rad^2
_THICKNESS = 0.4  # of a straight piece of wall, as a share of its window
_STEPS = 12
_SETTLED = 2e-4


@dataclass(frozen=True, slots=True)
class Match:
    """The pose of a stop after matching, its covariance `(3, 3)`, and how it came about; `score` is the best sum per point."""

    pose: Floats
    covariance: Floats
    verdict: Verdict
    score: float = 0.0


@dataclass(frozen=True, slots=True)
class Shift:
    """Whole cells, and the sum of the map under the points shifted so."""

    rows: int
    cols: int
    total: float


def best_shift(sums: Floats) -> Shift:
    """The shift with the largest of `sums` (2r+1, 2r+1); of equal ones the smallest shift."""
    return smallest_shift(sums, sums == sums.max())


def smallest_shift(sums: Floats, tied: NDArray[np.bool_]) -> Shift:
    """The smallest of the `tied` shifts (2r+1, 2r+1); of equally small ones that with the largest sum."""
    reach = sums.shape[0] // 2
    rows, cols = np.nonzero(tied)
    rows, cols, totals = rows - reach, cols - reach, sums[tied]
    k = int(np.lexsort((-totals, rows**2 + cols**2))[0])
    return Shift(int(rows[k]), int(cols[k]), float(totals[k]))


def tied_with(
    best: Shift, sums: Floats, values: Floats, cells: NDArray[np.int64], sigmas: float
) -> NDArray[np.bool_]:
    """Which shifts' sums (2r+1, 2r+1) are not less than the best by more than `sigmas` standard errors of the difference.

    The error is that of a sum of paired differences: where points are as well off at both shifts, or some better and some
    worse, the difference of the sums says nothing.
    """
    squares = shifted_changes(values, cells, sums.shape[0] // 2, best.rows, best.cols)
    return np.asarray(best.total - sums <= sigmas * np.sqrt(squares))


def match_by_shift(
    values: Floats,
    geometry: GridGeometry,
    ends: BeamEnds,
    prior: Floats,
    covariance: Floats,
    config: ShiftMatching,
) -> Match:
    """The paper's match on its grid pos (rows, cols): whole cells, no rotation, the odometry only says where the window lies.

    A shift of nothing teaches nothing: the covariance stays.
    """
    if len(ends) < config.least_points:
        return Match(prior, covariance, "too_few_points")
    cells = geometry.cells(ends.in_map(prior))
    sums = shifted_sums(values, cells, config.window_cells)
    best = best_shift(sums)
    on_walls = _occupied(values, cells + np.array([best.rows, best.cols]))
    if best.total <= 0.0 or on_walls < config.least_share * len(ends):
        return Match(prior, covariance, "no_match", best.total / len(ends))
    shift = smallest_shift(sums, tied_with(best, sums, values, cells, config.tie_sigmas))
    score = shift.total / len(ends)
    if not (shift.rows or shift.cols):
        return Match(prior, covariance, "matched", score)
    way = geometry.resolution_m * np.array([shift.cols, shift.rows])
    pose = prior + np.append(se2.transform_points([0.0, 0.0, geometry.yaw_rad], way[None])[0], 0.0)
    cell = np.array([geometry.resolution_m**2, geometry.resolution_m**2, covariance[2, 2]])
    return Match(pose, np.diag(cell), "matched", score)


def _occupied(values: Floats, cells: NDArray[np.int64]) -> int:
    """How many cells `(n, 2)` are occupied (pos > 0)."""
    row, col = cells[((cells >= 0) & (cells < values.shape)).all(axis=1)].T
    return int(np.count_nonzero(values[row, col] > 0.0))


class WallMatcher:
    """The map as the search sees it: spots of readings for shift and rotation, lines of walls for the rest."""

    def __init__(
        self,
        config: SearchMatching,
        noise: RangeNoise,
        resolution_m: float,
        line_window_m: float,
        memory_limit_mb: float,
    ) -> None:
        self._config, self._noise = config, noise
        self._thickest_m = _THICKNESS * line_window_m
        self._spots = GrowingGrid(resolution_m, memory_limit_mb)
        self._walls = WallSums(line_window_m / 3.0, memory_limit_mb)
        sigma = max(_SPOT_M, resolution_m) / resolution_m
        along = np.arange(-int(3 * sigma), int(3 * sigma) + 1)
        self._spot = np.exp(-0.5 * (along[:, None] ** 2 + along[None, :] ** 2) / sigma**2)

    def add(self, points: Floats, weights: Floats) -> None:
        """Take in points of walls `(n, 2)` in the map, with weights `(n,)` of at most 1 (for the spots)."""
        if not len(points):
            return
        self._spots.cover(points, len(self._spot) // 2)
        add_spots(self._spots.values, self._spots.cells(points), self._spot, np.ones(len(points)))
        self._walls.add(points, weights)

    def match(self, ends: BeamEnds, prior: Floats, covariance: Floats) -> Match:
        """Search, refuse what is ambiguous, refine."""
        if len(ends) < self._config.least_points:
            return Match(prior, covariance, "too_few_points")
        if not self._spots.values.size:
            return Match(prior, covariance, "first")
        widened = covariance + np.diag(_LEAST_PRIOR)
        found, spread, score = self.search(ends, prior, widened)
        if score <= 0.0:
            return Match(prior, covariance, "no_match")
        if spread > self._config.ambiguous_m:
            return Match(prior, covariance, "ambiguous", score)
        pose, refined, on_walls = self.refine(ends, found, prior, widened)
        if on_walls < self._config.least_points:
            return Match(prior, covariance, "no_match", score)
        return Match(pose, refined, "matched", score)

    def search(self, ends: BeamEnds, prior: Floats, covariance: Floats) -> tuple[Floats, float, float]:
        """The best pose of the window, the position's deviation over the window (m), and the best sum per point."""
        config, resolution = self._config, self._spots.resolution_m
        farthest = max(float(np.hypot(*ends.points.T).max()), resolution)
        count = int(np.ceil(config.rotation_rad * farthest / resolution))
        turns = np.linspace(-config.rotation_rad, config.rotation_rad, 2 * count + 1)
        if not count:
            turns = np.zeros(1)
        sums = np.empty((len(turns), *[2 * config.window_cells + 1] * 2))
        for k, turn in enumerate(turns.tolist()):
            points = ends.in_map(prior + np.array([0.0, 0.0, turn]))
            sums[k] = shifted_sums(self._spots.values, self._spots.cells(points), config.window_cells)
        along = np.asarray(resolution * np.arange(-config.window_cells, config.window_cells + 1), np.float64)
        information: Floats = np.asarray(np.linalg.inv(covariance), np.float64)
        score = config.point_weight * sums - 0.5 * _distances(information, turns, along)
        best = np.unravel_index(int(np.argmax(score)), score.shape)
        share = np.exp(score - score[best]).sum(axis=0)  # of each shift, whatever the turn
        share /= share.sum()
        squares = along**2
        mean_x, mean_y = float(share.sum(axis=0) @ along), float(share.sum(axis=1) @ along)
        spread = share.sum(axis=0) @ squares + share.sum(axis=1) @ squares - mean_x**2 - mean_y**2
        offset = np.array([along[best[2]], along[best[1]], turns[best[0]]])
        return prior + offset, math.sqrt(max(float(spread), 0.0)), float(sums[best]) / len(ends)

    def refine(
        self, ends: BeamEnds, start: Floats, prior: Floats, covariance: Floats
    ) -> tuple[Floats, Floats, int]:
        """Gauss-Newton: points on the lines of their walls, the odometry as prior. Pose, covariance, points on walls."""
        information = np.linalg.inv(covariance)
        variances = np.column_stack(self._noise.variances(ends.ranges_m))
        pose, hessian, on_walls = start.copy(), information, 0
        for _ in range(_STEPS):
            turn = np.array([0.0, 0.0, pose[2]])
            arms, directions = (se2.transform_points(turn, v) for v in (ends.points, ends.directions))
            of_walls, gradient, on_walls = self._walls.equations(
                pose[:2], arms, directions, variances, self._thickest_m
            )
            away = pose - prior
            away[2] = float(se2.wrap_angle(away[2]))
            hessian = information + of_walls
            step = -np.linalg.solve(hessian, gradient + information @ away)
            pose = pose + step
            if np.abs(step).max() < _SETTLED:
                break
        return pose, np.linalg.inv(hessian), on_walls


def _distances(information: Floats, turns: Floats, along: Floats) -> Floats:
    """Squared Mahalanobis distances (turns, y, x) of all offsets (x, y, turn) with x and y out of `along`."""
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = information.tolist()
    x, y = along[None, :], along[:, None]
    flat = xx * x**2 + 2.0 * xy * x * y + yy * y**2
    tilted = 2.0 * (xt * x + yt * y)
    return np.asarray(flat + turns[:, None, None] * tilted + (tt * turns**2)[:, None, None])
