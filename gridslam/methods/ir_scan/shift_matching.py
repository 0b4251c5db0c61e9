"""The paper's match (section 2.6): whole-cell shifts of a scan on the grid pos, without rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared.infrared_beams import shifted_changes, shifted_sums
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.ir_scan.stops import StopMatch
from gridslam.sensors.infrared import ReliableReadings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ShiftSettings:
    """Settings of `match_by_shift`; see `MatchingConfig` and `AdvancedMatching`.

    The paper does not say when two sums tie. The sums of a few hundred noisy points are never equal: along a bare wall all shifts
    are equally good, and the largest sum is a matter of chance. So sums tie if they differ by at most `tie_sigmas` standard
    errors.
    """

    window_cells: int = 10
    min_points: int = 10
    min_inlier_ratio: float = 0.3
    tie_sigmas: float = 2.5


@dataclass(frozen=True, slots=True)
class CellShift:
    """A shift by whole cells, and the sum `total` of pos under the points that are shifted by it."""

    rows: int
    cols: int
    total: float


def best_shift(sums: Floats) -> CellShift:
    """The shift with the largest of `sums` `(2r+1, 2r+1)`, whose middle is no shift; the smallest shift if several are equal."""
    return smallest_shift(sums, sums == sums.max())


def smallest_shift(sums: Floats, candidates: NDArray[np.bool_]) -> CellShift:
    """The smallest of the `candidates` `(2r+1, 2r+1)`; of equally small shifts the one with the largest sum."""
    max_shift = sums.shape[0] // 2
    rows, cols = np.nonzero(candidates)
    rows, cols, totals = rows - max_shift, cols - max_shift, sums[candidates]
    k = int(np.lexsort((-totals, rows**2 + cols**2))[0])
    return CellShift(int(rows[k]), int(cols[k]), float(totals[k]))


def shifts_that_tie(
    best: CellShift, sums: Floats, values: Floats, cells: Ints, sigmas: float
) -> NDArray[np.bool_]:
    """Mask `(2r+1, 2r+1)` of the shifts whose sums are at most `sigmas` standard errors of the difference below the best.

    The error is that of a sum of paired differences, one for each point: points that are equally good at both shifts do not
    contribute to it.
    """
    squares = shifted_changes(values, cells, sums.shape[0] // 2, best.rows, best.cols)
    return np.asarray(best.total - sums <= sigmas * np.sqrt(squares))


def match_by_shift(
    values: Floats,
    geometry: GridGeometry,
    readings: ReliableReadings,
    prior: StopMatch,
    settings: ShiftSettings,
) -> StopMatch:
    """The match of a scan on the grid pos `values` `(rows, cols)`; `prior` is the predicted pose, the centre of the window.

    A shift of zero keeps the covariance of the prior; any other has the standard deviation of a cell.
    """
    if len(readings) < settings.min_points:
        return StopMatch(prior.pose, prior.covariance, "too_few_points")
    cells = geometry.cells(readings.in_map(prior.pose))
    sums = shifted_sums(values, cells, settings.window_cells)
    best = best_shift(sums)
    inliers = _count_occupied(values, cells + np.array([best.rows, best.cols]))
    if best.total <= 0.0 or inliers < settings.min_inlier_ratio * len(readings):
        return StopMatch(prior.pose, prior.covariance, "no_match", best.total / len(readings))
    shift = smallest_shift(sums, shifts_that_tie(best, sums, values, cells, settings.tie_sigmas))
    score = shift.total / len(readings)
    if not (shift.rows or shift.cols):
        return StopMatch(prior.pose, prior.covariance, "matched", score)
    offset = geometry.resolution_m * np.array([shift.cols, shift.rows])
    pose = prior.pose + np.append(se2.transform_points([0.0, 0.0, geometry.yaw_rad], offset[None])[0], 0.0)
    cell = np.array([geometry.resolution_m**2, geometry.resolution_m**2, prior.covariance[2, 2]])
    return StopMatch(pose, np.diag(cell), "matched", score)


def _count_occupied(values: Floats, cells: Ints) -> int:
    """Number of `cells` `(n, 2)` that are occupied (pos > 0)."""
    row, col = cells[((cells >= 0) & (cells < values.shape)).all(axis=1)].T
    return int(np.count_nonzero(values[row, col] > 0.0))
