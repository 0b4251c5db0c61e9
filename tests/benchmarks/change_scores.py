"""How well the changes between drives were found, and whether the joint map has kept what stands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.maps.occupancy import OccupancyGrid
from tests.benchmarks.changed_worlds import CELL_M, Drives, dense
from tests.benchmarks.map_samples import sample

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Where a true point lies in a map follows from the path near it, so that errors of the path count as such and not as changes
TILE_M, PATH_AROUND_M, MIN_POSES = 4.0, 6.0, 20
NEAR_M = 0.15  # a reported cell this near to a changed piece is right
OCCUPIED, FREE = 0.65, 0.35  # probabilities


def path_error_m(path: Trajectory, truth: Trajectory) -> float:
    """The root mean square error (m) of a path."""
    true, inside = truth.at(path.stamps_ns)
    found = find_alignment(path.poses[inside], true[inside], "se2")
    assert found is not None
    errors = se2.compose(found.T_truth_estimate, path.poses[inside])[:, :2] - true[inside, :2]
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def in_map(path: Trajectory, truth: Trajectory, points: Floats) -> Floats:
    """True points `(n, 2)` in the map of a path, aligned with the poses of the path near them."""
    true, inside = truth.at(path.stamps_ns)
    true, poses = true[inside], path.poses[inside]
    tiles, owner = np.unique(np.floor(points / TILE_M), axis=0, return_inverse=True)
    moved = np.empty_like(points)
    for tile, corner in enumerate(tiles):
        away = np.hypot(*(true[:, :2] - TILE_M * (corner + 0.5)).T)
        near = away <= away.min() + PATH_AROUND_M
        near |= near.sum() < MIN_POSES
        found = find_alignment(true[near], poses[near], "se2")
        assert found is not None
        is_here = owner.ravel() == tile
        moved[is_here] = se2.transform_points(found.T_truth_estimate, points[is_here])
    return moved


def contour_points(corners: Floats) -> Floats:
    """Points about a cell apart along the sides of a piece, or along the leaf of a door."""
    is_leaf = len(corners) == 2
    sides = [(corners[0], corners[1])] if is_leaf else zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([dense(a, b) for a, b in sides])


def scores(drives: Drives, k: int) -> tuple[int, int, int, int]:
    """Reported cells that are right, and all; true cells that were reported, and all, of drive number k.

    A true cell lies on the contour of a changed piece, stands in the map of the drive that met it alone, and is free in that
    of the other one alone. A cell is right also where a piece changed earlier, and no drive has seen that before this one.
    """
    result = drives.results[k]
    path, truth = result.trajectories[f"trajectory_{k + 1}"], drives.truths[k]
    layer = result.layers["changes"]
    right = reported = found = true = 0
    for sign, pieces, with_piece, without in (
        (1, drives.appeared[k], k, k - 1),
        (-1, drives.vanished[k], k - 1, k),
    ):
        cells = layer.geometry.centres(np.argwhere(np.asarray(layer.values) == sign * (k + 1)))
        reported += len(cells)
        contours = np.concatenate([np.zeros((0, 2)), *(contour_points(piece) for piece in pieces)])
        at = in_map(path, truth, contours)
        near = np.concatenate([at, in_map(path, truth, _changed_unseen(drives, k, sign))])
        if len(cells) and len(near):
            right += int((cKDTree(near).query(cells)[0] <= NEAR_M).sum())
        if not pieces:
            continue
        stands, was_free = _state(drives, with_piece, contours)[0], _state(drives, without, contours)[1]
        is_true = stands & was_free
        true += int(is_true.sum())
        if len(cells) and is_true.any():
            found += int((cKDTree(cells).query(at[is_true])[0] <= NEAR_M).sum())
    return right, reported, found, true


def _changed_unseen(drives: Drives, k: int, sign: int) -> Floats:
    """Points `(n, 2)` of pieces that appeared (1), or vanished (-1), before drive k, and that no drive since has seen so."""
    changed, back = (drives.appeared, drives.vanished)[::sign]
    points = [np.zeros((0, 2))]
    for j in range(1, k):
        later = [piece for each in back[j + 1 : k + 1] for piece in each]
        lasting = [piece for piece in changed[j] if not any(np.array_equal(piece, other) for other in later)]
        if lasting:
            contours = np.concatenate([contour_points(piece) for piece in lasting])
            states = [_state(drives, drive, contours)[0 if sign > 0 else 1] for drive in range(j, k)]
            points.append(contours[~np.any(states, axis=0)])
    return np.concatenate(points)


def static_walls(drives: Drives, k: int) -> tuple[int, int, float]:
    """Points of static walls that drive k and the one before it have in their own maps: those lost in the joint map, and all.

    A point is lost without an occupied cell within `NEAR_M`. The third value is the length of the longest lost piece (m).
    """
    result = drives.results[k]
    assert result.occupancy is not None
    stands = _state(drives, k, drives.static)[0] & _state(drives, k - 1, drives.static)[0]
    walls_at = in_map(result.trajectories[f"trajectory_{k + 1}"], drives.truths[k], drives.static[stands])
    occupied = np.argwhere(np.nan_to_num(result.occupancy.probability, nan=0.0) > OCCUPIED)
    walls = cKDTree(result.occupancy.geometry.centres(occupied))
    is_lost = walls.query(walls_at)[0] > NEAR_M
    return int(is_lost.sum()), int(stands.sum()), longest_piece_m(drives.static[stands][is_lost])


def longest_piece_m(points: Floats) -> float:
    """The length of the longest piece of a wall among points `(n, 2)` about a cell apart."""
    pairs = (
        cKDTree(points).query_pairs(2.0 * CELL_M, output_type="ndarray")
        if len(points)
        else np.zeros((0, 2), int)
    )
    links = coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(points), len(points)))
    count, label = connected_components(links, directed=False)
    return max(
        (CELL_M + float(np.hypot(*np.ptp(points[label == c], axis=0))) for c in range(count)), default=0.0
    )


def _state(drives: Drives, k: int, points: Floats) -> tuple[Bools, Bools]:
    """Whether true points are occupied, and free, in the map of drive k alone."""
    alone = drives.alone[k]
    assert alone.occupancy is not None
    return states_at(alone.occupancy, in_map(alone.trajectory, drives.truths[k], points))


def states_at(grid: OccupancyGrid, at: Floats) -> tuple[Bools, Bools]:
    """Whether there is an occupied cell at points or beside them, and whether none there is anything but free."""
    around = np.stack(
        [sample(grid, at + np.array(d) * CELL_M) for d in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
    )
    values = np.where(np.isnan(around), 0.5, around)
    return np.asarray(values.max(axis=0) > OCCUPIED), np.asarray(values.max(axis=0) < FREE)
