"""Errors of a built map against the true one: distances between walls, overlap, log loss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import OccupancyGrid, marked_cells

OCCUPIED_FROM = 0.5
_MIN_PROBABILITY = 1e-6
_CELLS_AT_ONCE = 1 << 20


@dataclass(frozen=True, slots=True)
class WallDistances:
    """Distances (m) between the centres of wall cells.

    `accuracy` `(n,)`: from each mapped wall cell to the nearest true one. `completeness` `(m,)`: from each true
    wall cell that borders on free space to the nearest mapped one.
    """

    accuracy: NDArray[np.float64]
    completeness: NDArray[np.float64]


def wall_distances(
    built: OccupancyGrid,
    truth: OccupancyGrid,
    T_truth_built: NDArray[np.float64],
    completeness_radius_m: float | None = None,
) -> WallDistances:
    """Both distances, with the built map transformed by `T_truth_built` (x, y, yaw) into the frame of the ground truth.

    A wall cell has a probability above 0.5. The inside of thick true walls cannot be observed and counts for accuracy only.
    With `completeness_radius_m`, completeness excludes true walls farther than that from every known cell of the built map.
    Empty if one of the maps has no wall.
    """
    mapped = se2.transform_points(T_truth_built, _centres(built, _walls(built)))
    true = _centres(truth, _walls(truth))
    visible = _centres(truth, _borders_on_free(truth))
    if completeness_radius_m is not None and len(visible):
        visible = visible[_near_known(built, T_truth_built, visible, completeness_radius_m)]
    return WallDistances(_nearest(mapped, true), _nearest(visible, mapped))


def intersection_over_union(
    built: OccupancyGrid, truth: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> float:
    """Intersection over union of the wall cells; NaN without any wall.

    Each cell known in the true map is compared with the cell of the built map under its centre.
    """
    built_values = _on_cells_of(truth, built, T_truth_built)
    known = ~np.isnan(truth.probability)
    true_wall, built_wall = _walls(truth), known & (built_values > OCCUPIED_FROM)
    union = np.count_nonzero(true_wall | built_wall)
    return float(np.count_nonzero(true_wall & built_wall) / union) if union else float("nan")


def log_loss(
    probability: OccupancyGrid, truth: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> tuple[float, int]:
    """Mean of -ln P(true state) over the cells known in both maps (NaN without any), and the number of these cells.

    Probabilities are clipped to [1e-6, 1 - 1e-6], so that a single wrong certainty does not make the loss infinite.
    """
    p = _on_cells_of(truth, probability, T_truth_built)
    both = ~np.isnan(p) & ~np.isnan(truth.probability)
    if not both.any():
        return float("nan"), 0
    clipped = np.clip(p[both].astype(np.float64), _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY)
    loss = -np.log(np.where(_walls(truth)[both], clipped, 1.0 - clipped))
    return float(loss.mean()), int(np.count_nonzero(both))


def sample(grid: OccupancyGrid, points_xy: NDArray[np.float64]) -> NDArray[np.float32]:
    """Probabilities `(n,)` of the cells that contain the points `(n, 2)` (m, map frame); NaN outside the grid."""
    cells = grid.geometry.cells(points_xy)
    rows, cols = grid.probability.shape
    inside = (cells >= 0).all(axis=1) & (cells[:, 0] < rows) & (cells[:, 1] < cols)
    values = np.full(len(cells), np.nan, np.float32)
    values[inside] = grid.probability[cells[inside, 0], cells[inside, 1]]
    return values


def wall_points(grid: OccupancyGrid) -> NDArray[np.float64]:
    """Centres `(n, 2)` (m) of the wall cells."""
    return _centres(grid, _walls(grid))


def _walls(grid: OccupancyGrid) -> NDArray[np.bool_]:
    return np.asarray(grid.probability > OCCUPIED_FROM)


def _borders_on_free(grid: OccupancyGrid) -> NDArray[np.bool_]:
    """Mask of wall cells with a free cell among their four neighbours."""
    free = np.pad(grid.probability <= OCCUPIED_FROM, 1)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    return _walls(grid) & beside


def _centres(grid: OccupancyGrid, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    return grid.geometry.centres(marked_cells(mask))


def _near_known(
    built: OccupancyGrid, T_truth_built: NDArray[np.float64], points: NDArray[np.float64], radius_m: float
) -> NDArray[np.bool_]:
    """Which points `(n, 2)` of the truth's frame lie at most `radius_m` from the centre of a known cell.

    The nearest is the cell in which the point lies, where that is known, and else one beside an unknown cell.
    """
    known = ~np.isnan(built.probability)
    border = known.copy()
    border[1:-1, 1:-1] &= ~(known[:-2, 1:-1] & known[2:, 1:-1] & known[1:-1, :-2] & known[1:-1, 2:])
    cells = built.geometry.cells(se2.transform_points(se2.inverse(T_truth_built), points))
    inside = np.asarray(((cells >= 0) & (cells < known.shape)).all(axis=1))
    own = inside.copy()
    own[inside] = known[cells[inside, 0], cells[inside, 1]]
    distances = np.full(len(points), np.inf)
    centres = se2.transform_points(T_truth_built, built.geometry.centres(cells[own]))
    distances[own] = np.hypot(*(points[own] - centres).T)
    around = se2.transform_points(T_truth_built, built.geometry.centres(marked_cells(border, "border")))
    if len(around) and not own.all():
        distances[~own] = _nearest(points[~own], around)
    return np.asarray(distances <= radius_m)


def _on_cells_of(
    truth: OccupancyGrid, built: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Probabilities of the built map at the cell centres of the true one, `(rows, cols)`, computed in blocks of rows."""
    rows, cols = truth.probability.shape
    T_built_truth = se2.inverse(T_truth_built)
    values = np.empty((rows, cols), np.float32)
    at_once = max(_CELLS_AT_ONCE // max(cols, 1), 1)
    for first in range(0, rows, at_once):
        block = values[first : first + at_once]
        cells = np.indices(block.shape, dtype=np.int64).reshape(2, -1).T + np.array([first, 0], np.int64)
        centres = se2.transform_points(T_built_truth, truth.geometry.centres(cells))
        block[:] = sample(built, centres).reshape(block.shape)
    return values


def _nearest(points: NDArray[np.float64], among: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances `(n,)` from each point to the nearest of `among`; empty if `among` is empty."""
    if not len(points) or not len(among):
        return np.zeros(0)
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(among).query(points)
    return np.asarray(distances, dtype=np.float64)
