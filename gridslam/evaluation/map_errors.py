"""Errors of a built map against the true one: distances between walls, overlap, log loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.occupancy import OccupancyGrid, refuse_noise, values_under

Mask = Callable[[NDArray[np.float32]], NDArray[np.bool_]]

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
    mapped = se2.transform_points(T_truth_built, wall_points(built))
    true = wall_points(truth)
    visible = truth.geometry.centres(_cells_that(_is_wall_beside_free, truth))
    if completeness_radius_m is not None and len(visible):
        visible = visible[_near_known(built, T_truth_built, visible, completeness_radius_m)]
    return WallDistances(_nearest(mapped, true), _nearest(visible, mapped))


def intersection_over_union(
    built: OccupancyGrid, truth: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> float:
    """Intersection over union of the wall cells of both maps, given T_truth_built `(3,)`; NaN without any wall.

    Each cell known in the true map is compared with the cell of the built map under its centre.
    """
    both = either = 0
    for true, mapped in _on_cells_of(truth, built, T_truth_built):
        true_wall, built_wall = true > OCCUPIED_FROM, ~np.isnan(true) & (mapped > OCCUPIED_FROM)
        both += int(np.count_nonzero(true_wall & built_wall))
        either += int(np.count_nonzero(true_wall | built_wall))
    return both / either if either else float("nan")


def log_loss(
    probability: OccupancyGrid, truth: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> tuple[float, int]:
    """Mean of -ln P(true state) over the cells known in both maps (NaN without any), and the number of these cells.

    T_truth_built `(3,)` is the built map's frame in the true map's.
    Probabilities are clipped to [1e-6, 1 - 1e-6], so that a single wrong certainty does not make the loss infinite.
    """
    total, count = 0.0, 0
    for true, p in _on_cells_of(truth, probability, T_truth_built):
        known = ~np.isnan(p) & ~np.isnan(true)
        clipped = np.clip(p[known].astype(np.float64), _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY)
        total -= float(np.log(np.where(true[known] > OCCUPIED_FROM, clipped, 1.0 - clipped)).sum())
        count += len(clipped)
    return (total / count if count else float("nan")), count


def wall_points(grid: OccupancyGrid) -> NDArray[np.float64]:
    """Centres `(n, 2)` (m) of the wall cells. Raises MapError: they are too many."""
    return grid.geometry.centres(_cells_that(_is_wall, grid))


def _cells_that(are: Mask, grid: OccupancyGrid, what: str = "wall") -> NDArray[np.int64]:
    """Cells (row, col) `(n, 2)` that a mask marks, strip by strip of a large map. Raises MapError: they are too many.

    The mask sees a strip with one more cell on each side, unknown outside the map.
    """
    found, count = [np.zeros((0, 2), np.int64)], 0
    for first, strip in _strips(grid):
        around = grid.probability[max(first - 1, 0) : first + len(strip) + 1]
        missing = int(first == 0), int(first + len(strip) == len(grid.probability))
        cells = np.argwhere(are(np.pad(around, (missing, (1, 1)), constant_values=np.nan)))
        count += len(cells)
        refuse_noise(grid.probability.shape, count, what)
        found.append(cells + np.array([first, 0]))
    return np.concatenate(found)


def _strips(grid: OccupancyGrid) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Some rows of the map at once, with the index of their first one."""
    rows, cols = grid.probability.shape
    at_once = max(_CELLS_AT_ONCE // max(cols, 1), 1)
    for first in range(0, rows, at_once):
        yield first, grid.probability[first : first + at_once]


def _is_wall(p: NDArray[np.float32]) -> NDArray[np.bool_]:
    return np.asarray(p[1:-1, 1:-1] > OCCUPIED_FROM)


def _is_wall_beside_free(p: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Wall cells with a free cell among their four neighbours."""
    free = p <= OCCUPIED_FROM
    return _is_wall(p) & (free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:])


def _is_known_beside_unknown(p: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Known cells with an unknown one, or none, among their four neighbours."""
    known = ~np.isnan(p)
    return known[1:-1, 1:-1] & ~(known[:-2, 1:-1] & known[2:, 1:-1] & known[1:-1, :-2] & known[1:-1, 2:])


def _near_known(
    built: OccupancyGrid, T_truth_built: NDArray[np.float64], points: NDArray[np.float64], radius_m: float
) -> NDArray[np.bool_]:
    """Mask `(n,)` of the points `(n, 2)` in the truth's frame that lie within `radius_m` of the centre of a known cell.

    The nearest is the cell in which the point lies, where that is known, and else one beside an unknown cell.
    """
    cells = built.geometry.cells(se2.transform_points(se2.inverse(T_truth_built), points))
    own = np.asarray(((cells >= 0) & (cells < built.probability.shape)).all(axis=1))
    own[own] = ~np.isnan(built.probability[cells[own, 0], cells[own, 1]])
    distances = np.full(len(points), np.inf)
    centres = se2.transform_points(T_truth_built, built.geometry.centres(cells[own]))
    distances[own] = np.hypot(*(points[own] - centres).T)
    border = _cells_that(_is_known_beside_unknown, built, "border")
    around = se2.transform_points(T_truth_built, built.geometry.centres(border))
    if len(around) and not own.all():
        distances[~own] = _nearest(points[~own], around)
    return np.asarray(distances <= radius_m)


def _on_cells_of(
    truth: OccupancyGrid, built: OccupancyGrid, T_truth_built: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Strips of the true map, each with the built map's probabilities at the centres of its cells."""
    T_built_truth = se2.inverse(T_truth_built)
    for first, strip in _strips(truth):
        part = slice(first, first + len(strip)), slice(0, strip.shape[1])
        yield strip, values_under(built, T_built_truth, truth.geometry, part)


def _nearest(points: NDArray[np.float64], among: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances `(n,)` from each point to the nearest of `among`; empty if `among` is empty."""
    if not len(points) or not len(among):
        return np.zeros(0)
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(among).query(points)
    return np.asarray(distances, dtype=np.float64)
