"""All stops at once (offline): poses under which the readings of all stops share the lines of the walls.

A piece of wall is a cell of a coarse lattice; its line (offset and tilt) is eliminated from the normal equations, so that
only poses are left, as in bundle adjustment. Two lattices, shifted by half a cell, share the points, so that no wall is
cut everywhere.
Odometry ties each stop to the one before, fixes tie stops to the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, jacobians, residuals
from gridslam.kernels.wall_lines import equations_of_walls
from gridslam.methods.ir_scan.stops import Place
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_HELD = 1e-10  # variance of the first pose
_LEAST_ODOMETRY = np.diag([1e-7, 1e-7, 1e-7])
_MAP_M = 0.002  # what a wall differs from a straight line
_ROBUST_SIGMAS = 2.5
_THICKNESS = 0.5  # of a straight piece of wall, as a share of its length
_LEAST_POINTS = 4
_SETTLED = 8e-4


@dataclass(frozen=True, slots=True)
class Readings:
    """The reliable readings of all places: place, end point and direction `(n, 2)` in the robot's frame, range and bel `(n,)`."""

    place: Ints
    points: Floats
    directions: Floats
    ranges_m: Floats
    bel: Floats

    @staticmethod
    def of(places: Sequence[Place]) -> Readings:
        """Those of the places that have a scan, in order."""
        scans = [(k, place.ends) for k, place in enumerate(places) if place.ends is not None]
        return Readings(
            np.concatenate([np.zeros(0, np.int64), *(np.full(len(ends), k) for k, ends in scans)]),
            np.concatenate([np.zeros((0, 2)), *(ends.points for _, ends in scans)]),
            np.concatenate([np.zeros((0, 2)), *(ends.directions for _, ends in scans)]),
            np.concatenate([np.zeros(0), *(ends.ranges_m for _, ends in scans)]),
            np.concatenate([np.zeros(0), *(ends.bel for _, ends in scans)]),
        )

    def in_map(self, poses: Floats) -> Floats:
        """End points `(n, 2)` under poses of the places `(p, 3)`."""
        return rotated(self.points, poses[self.place, 2]) + poses[self.place, :2]

    def variances(self, normals: Floats, poses: Floats, noise: RangeNoise) -> Floats:
        """Variances `(n,)` along normals `(n, 2)` in the map."""
        along = np.sum(normals * rotated(self.directions, poses[self.place, 2]), axis=1) ** 2
        radial, across = noise.variances(self.ranges_m)
        return np.asarray(along * radial + (1.0 - along) * across)


def rotated(vectors: Floats, angles: Floats) -> Floats:
    """Vectors `(n, 2)`, each turned by its angle `(n,)`."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def adjust(places: Sequence[Place], cell_m: float, iterations: int, noise: RangeNoise) -> Floats:
    """Adjusted poses `(p, 3)`. The first place stays where it is unless fixes say where the map lies."""
    poses = np.array([place.pose for place in places])
    readings, edges = Readings.of(places), odometry_edges(places)
    if not len(readings.place):
        return poses
    for _ in range(iterations):
        hessian, gradient = _odometry_terms(poses, edges)
        for term in (_fix_terms(poses, places), *_wall_terms(poses, readings, cell_m, noise)):
            hessian, gradient = hessian + term[0], gradient + term[1]
        step = spsolve(hessian.tocsc(), -gradient).reshape(-1, 3)
        poses = poses + step
        poses[:, 2] = se2.wrap_angle(poses[:, 2])
        if np.abs(step).max() < _SETTLED:
            break
    return poses


def odometry_edges(places: Sequence[Place]) -> Edges:
    """From each place to the next, where odometry says how they lie."""
    tied = [k for k in range(1, len(places)) if places[k].has_odometry]
    stretches = [stretch for k in tied if (stretch := places[k].stretch) is not None]
    covariances = [np.linalg.inv(stretch.covariance + _LEAST_ODOMETRY) for stretch in stretches]
    index = np.array(tied, np.int64)
    return Edges(
        index - 1,
        index,
        np.array([stretch.T_stop_now for stretch in stretches]).reshape(-1, 3),
        np.array(covariances).reshape(-1, 3, 3),
        np.zeros(len(index), bool),
    )


def _odometry_terms(poses: Floats, edges: Edges) -> tuple[sparse.csr_matrix, Floats]:
    """Normal equations of the odometry."""
    size = 3 * len(poses)
    if not len(edges):
        return sparse.csr_matrix((size, size)), np.zeros(size)
    error = residuals(poses, edges).ravel()
    by_source, by_target = jacobians(poses, edges)
    m = len(edges)
    rows = np.broadcast_to(np.arange(3 * m).reshape(m, 3, 1), (m, 3, 3))
    columns = [
        np.broadcast_to(3 * k[:, None, None] + np.arange(3), (m, 3, 3)) for k in (edges.source, edges.target)
    ]
    J = sparse.csr_matrix(
        (
            np.concatenate([by_source.ravel(), by_target.ravel()]),
            (np.tile(rows.ravel(), 2), np.concatenate([c.ravel() for c in columns])),
        ),
        shape=(3 * m, size),
    )
    W = _block_diagonal(edges.information)
    return (J.T @ W @ J).tocsr(), np.asarray(J.T @ (W @ error))


def _fix_terms(poses: Floats, places: Sequence[Place]) -> tuple[sparse.csr_matrix, Floats]:
    """Normal equations of fixes; where the first place has none it is held."""
    size = 3 * len(poses)
    blocks = [np.zeros((3, 3)) for _ in places]
    gradient = np.zeros((len(poses), 3))
    for k, place in enumerate(places):
        for fix in place.fixes:
            information = np.linalg.inv(fix.covariance)
            away = poses[k] - fix.pose
            away[2] = float(se2.wrap_angle(away[2]))
            blocks[k] += information
            gradient[k] += information @ away
    if not places[0].fixes:
        blocks[0] += np.eye(3) / _HELD
        gradient[0] += (poses[0] - places[0].pose) / _HELD
    return _block_diagonal(np.array(blocks)), gradient.reshape(size)


def _wall_terms(
    poses: Floats, readings: Readings, cell_m: float, noise: RangeNoise
) -> list[tuple[sparse.csr_matrix, Floats]]:
    """Normal equations of the readings on the lines of their walls, one for each of the two lattices."""
    arms = rotated(readings.points, poses[readings.place, 2])
    directions = rotated(readings.directions, poses[readings.place, 2])
    points = arms + poses[readings.place, :2]
    variances = np.column_stack(noise.variances(readings.ranges_m))
    terms = []
    for corner in (0.0, 0.5):
        first, order = by_cell(points, cell_m, corner)
        equations = equations_of_walls(
            first,
            order,
            readings.place,
            points,
            arms,
            directions,
            variances,
            readings.bel,
            _LEAST_POINTS,
            _THICKNESS * cell_m,
            _MAP_M**2,
            _ROBUST_SIGMAS,
            len(poses),
        )
        terms.append(_eliminated(*equations))
    return terms


def by_cell(points: Floats, cell_m: float, corner: float) -> tuple[Ints, Ints]:
    """Points `(n, 2)` sorted by cell of a lattice, those of a cell in their order: where each cell begins `(cells + 1,)`, and the
    order. `corner` is the lattice's, in cells.
    """
    cells = np.floor(points / cell_m + corner).astype(np.int64)
    keys = cells[:, 0] * (int(np.ptp(cells[:, 1])) + 1) + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    begins = np.flatnonzero(np.diff(keys[order])) + 1
    return np.concatenate([[0], begins, [len(keys)]]), order


def _eliminated(
    by_place: Floats,
    gradient: Floats,
    of_walls: Floats,
    wall_gradient: Floats,
    counts: Ints,
    mixed_place: Ints,
    mixed: Floats,
) -> tuple[sparse.csr_matrix, Floats]:
    """Normal equations of the poses alone: each wall's offset and tilt eliminated (Schur complement).

    The arguments are what `equations_of_walls` returns.
    """
    w0, w1, w2 = (
        of_walls[:, 0] + 1.0,
        of_walls[:, 1],
        of_walls[:, 2] + 1.0,
    )  # walls without points stay regular
    inverse = np.stack([w2, -w1, -w1, w0], axis=1).reshape(-1, 2, 2) / (w0 * w2 - w1**2)[:, None, None]
    solved = np.repeat(inverse, counts, axis=0) @ mixed
    shape = (2 * len(counts), gradient.size)
    first = np.concatenate([[0], np.cumsum(np.repeat(3 * counts, 2))])
    order = _rows_of_pairs(counts)
    columns = (3 * mixed_place[:, None] + np.arange(3))[order >> 1].ravel()
    B, D = (
        sparse.csr_matrix((blocks.reshape(-1, 3)[order].ravel(), columns, first), shape=shape)
        for blocks in (mixed, solved)
    )
    hessian = _block_diagonal(by_place) - B.T.tocsr() @ D
    return hessian, gradient.ravel() - D.T @ wall_gradient.ravel()


def _rows_of_pairs(counts: Ints) -> Ints:
    """The order that puts rows (2 a pair, pairs wall by wall) so that all first rows of a wall come before its second rows."""
    total = int(counts.sum())
    wall, begins = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    place = np.arange(total) + begins[wall]  # of the pair's first row in the new order
    order = np.empty(2 * total, np.int64)
    order[place] = 2 * np.arange(total)
    order[place + counts[wall]] = 2 * np.arange(total) + 1
    return order


def _block_diagonal(blocks: Floats) -> sparse.csr_matrix:
    """Blocks `(n, 3, 3)` along the diagonal."""
    n = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()
