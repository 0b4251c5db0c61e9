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
from gridslam.methods.ir_scan.lines import lines_of_sums, moments
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

    def select(self, mask: NDArray[np.bool_]) -> Readings:
        """Those that the mask `(n,)` keeps."""
        return Readings(
            self.place[mask], self.points[mask], self.directions[mask], self.ranges_m[mask], self.bel[mask]
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
    size = 3 * len(poses)
    points = readings.in_map(poses)
    weights = readings.bel / noise.variances(readings.ranges_m)[0]
    of_points = moments(points, weights)
    terms = []
    for corner in (0.0, 0.5):
        cells = np.floor(points / cell_m + corner).astype(np.int64)
        keys = cells[:, 0] * (int(np.ptp(cells[:, 1])) + 1) + cells[:, 1]
        found, wall = np.unique(keys, return_inverse=True)
        count = len(found)
        lines = lines_of_sums(_sums(wall, of_points, count))
        good = lines.are_walls(_LEAST_POINTS, _THICKNESS * cell_m)[wall]
        wall, place, at = wall[good], readings.place[good], points[good]
        normals, centres = lines.normals[wall], lines.centres[wall]
        off = np.sum((at - centres) * normals, axis=1)
        along = (at - centres)[:, 0] * normals[:, 1] - (at - centres)[:, 1] * normals[:, 0]
        variance = readings.select(good).variances(normals, poses, noise) + _MAP_M**2
        weight = 0.5 * readings.bel[good] / variance / (1.0 + off**2 / variance / _ROBUST_SIGMAS**2) ** 2
        arm = at - poses[place, :2]
        jacobian = np.column_stack([normals, normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]])
        terms.append(_eliminated(jacobian, off, along, weight, wall, place, count, size))
    return terms


def _eliminated(
    jacobian: Floats,
    off: Floats,
    along: Floats,
    weight: Floats,
    wall: Ints,
    place: Ints,
    walls: int,
    size: int,
) -> tuple[sparse.csr_matrix, Floats]:
    """Normal equations of residuals off = n (p - c) - d - a * along, each wall's d and a eliminated (Schur complement).

    jacobian `(n, 3)` is the derivative of `off` by the pose of its place. All sums are taken by wall, by place, or by both.
    """
    weighted = weight[:, None] * jacobian
    by_place = _sums(place, (weighted[:, :, None] * jacobian[:, None, :]).reshape(-1, 9), size // 3)
    hessian = _block_diagonal(by_place.reshape(-1, 3, 3))
    gradient = _sums(place, weighted * off[:, None], size // 3).ravel()
    w0, w1, w2, r0, r1 = _sums(wall, weight[:, None] * _powers(along, off), walls).T
    pairs, pair = np.unique(wall * (size // 3) + place, return_inverse=True)
    mixed = _sums(pair, np.concatenate([weighted, weighted * along[:, None]], axis=1), len(pairs))
    at_wall, at_place = np.divmod(pairs, size // 3)
    rows = 2 * at_wall[:, None, None] + np.arange(2)[:, None]
    columns = 3 * at_place[:, None, None] + np.arange(3)
    shape = (len(pairs), 2, 3)
    places = (np.broadcast_to(rows, shape).ravel(), np.broadcast_to(columns, shape).ravel())
    B = sparse.csr_matrix((mixed.ravel(), places), shape=(2 * walls, size))
    w0, w2 = w0 + 1.0, w2 + 1.0  # walls without points stay regular
    det = w0 * w2 - w1**2
    beside = np.column_stack([-w1 / det, np.zeros(walls)]).ravel()[: 2 * walls - 1]
    inverse = sparse.diags(
        [np.column_stack([w2 / det, w0 / det]).ravel(), beside, beside], [0, 1, -1], format="csr"
    )
    from_walls = B.T @ inverse
    hessian = hessian - from_walls @ B
    return hessian, np.asarray(gradient - from_walls @ np.column_stack([r0, r1]).ravel())


def _powers(along: Floats, off: Floats) -> Floats:
    return np.stack([np.ones_like(along), along, along**2, off, along * off], axis=1)


def _block_diagonal(blocks: Floats) -> sparse.csr_matrix:
    """Blocks `(n, 3, 3)` along the diagonal."""
    n = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()


def _sums(group: Ints, values: Floats, groups: int) -> Floats:
    """Sums of the rows of `values` `(n, k)` by group: `(groups, k)`."""
    return np.stack([np.bincount(group, column, groups) for column in values.T], axis=1).astype(np.float64)
