"""All places together: robust least squares over their states, coarse to fine, with smoothness between neighbours.

A place that the drawing lacks has no wall within range, so its costs are constant and its neighbours alone place it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from gridslam.core import poses as se2
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIGMAS_M = (0.7, 0.45, 0.3)  # of walls from where they are drawn, coarse to fine
ITERATIONS = 6  # at each
WALL_WEIGHT, OPEN_WEIGHT = 0.25, 0.15  # of a point: neighbouring points and places see the same walls
OFFSET_STD_PER_M, OFFSET_STD_M = 0.12, 0.05  # of a place from where its neighbour expects it
ROTATION_STD, SCALE_STD = 0.07, 0.08  # per root metre between neighbours
ASPECT_STD, ASPECT_WEIGHT = 0.5, 0.1  # of the difference of a place's log scales
EDGE_WEIGHT = 0.5  # each edge is there in both directions
JUMP = 3.0  # residuals beyond this many standard deviations weigh ever less
PRIOR_DAMPING = 1e-6
STEP_LIMITS = np.array([0.5, 0.5, 0.15, 0.1, 0.1])  # metres, rad, log scales


@dataclass(frozen=True)
class Fitted:
    """States `(p, 5)` of the places and their cost: minus log-likelihood of views and edges."""

    states: Floats
    cost: float


class _Views:
    """The points of all places in one array."""

    def __init__(self, pieces: list[Floats]) -> None:
        self.place = np.repeat(np.arange(len(pieces)), [len(v) for v in pieces])
        self.offsets = np.concatenate(pieces) if pieces else np.zeros((0, 2))


class Refinement:
    """The problem for one map and one drawing."""

    def __init__(self, graph: PlaceGraph, evidence: DrawnEvidence) -> None:
        self._graph = graph
        self._evidence = evidence
        self._walls, self._open = _Views(graph.views), _Views(graph.open_views)
        self._fields = {
            name: np.stack([field, *_slopes(field)])
            for name, field in (("wall", evidence.to_wall), ("open", evidence.to_free))
        }
        both = np.concatenate([graph.edges, graph.edges[:, ::-1]])
        self._from, self._to = both[:, 0], both[:, 1]
        self._offsets = graph.centres[self._to] - graph.centres[self._from]
        self._lengths = np.maximum(np.hypot(*self._offsets.T), 0.3)

    def fit(self, states: Floats) -> Fitted:
        """Improve states `(p, 5)`."""
        states = states.copy()
        for sigma_m in SIGMAS_M:
            for _ in range(ITERATIONS):
                states = self._step(states, sigma_m)
        return Fitted(states, self.cost(states))

    def cost(self, states: Floats) -> float:
        """Truncated squares of the views, and heavy-tailed costs of the edges."""
        total = 0.0
        for name, weight in (("wall", WALL_WEIGHT), ("open", OPEN_WEIGHT)):
            residual, *_ = self._view_residuals(name, states)
            s = SIGMAS_M[-1]
            total += weight * float((residual**2 / (residual**2 + s * s)).sum())
        edges = self._edge_residuals(states)
        return total + 0.5 * float(JUMP**2 * np.log1p((edges / JUMP) ** 2).sum()) * EDGE_WEIGHT

    def _step(self, states: Floats, sigma_m: float) -> Floats:
        """States after one Gauss-Newton step, limited to `STEP_LIMITS`."""
        n = 5 * len(states)
        blocks: list[tuple[Ints, Ints, Floats]] = []
        gradient = np.zeros(n)
        for name, weight in (("wall", WALL_WEIGHT), ("open", OPEN_WEIGHT)):
            self._add_views(name, weight, states, sigma_m, blocks, gradient)
        self._add_edges(states, blocks, gradient)
        aspect = states[:, 3] - states[:, 4]
        first = 5 * np.arange(len(states)) + 3
        w = ASPECT_WEIGHT / ASPECT_STD**2
        for a, b, v in ((0, 0, w), (1, 1, w), (0, 1, -w), (1, 0, -w)):
            blocks.append((first + a, first + b, np.full(len(first), v)))
        gradient[first] += w * aspect
        gradient[first + 1] -= w * aspect
        rows, cols, values = (np.concatenate([b[k].ravel() for b in blocks]) for k in range(3))
        damping = np.arange(n)
        matrix = coo_matrix(
            (
                np.concatenate([values, np.full(n, PRIOR_DAMPING)]),
                (np.concatenate([rows, damping]), np.concatenate([cols, damping])),
            ),
            shape=(n, n),
        ).tocsc()
        step = -spsolve(matrix, gradient).reshape(-1, 5)
        scale = np.exp(0.5 * states[:, 3:].sum(axis=1))
        limits = STEP_LIMITS * np.column_stack([scale, scale, *np.ones((3, len(scale)))])
        states = states + np.clip(step, -limits, limits)
        states[:, 2] = se2.wrap_angle(states[:, 2])
        return states

    def _view_residuals(self, name: str, states: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Distances (m) of all points, their slopes `(n, 2)`, the points relative to their places, and scales `(n,)`."""
        views = self._walls if name == "wall" else self._open
        of = states[views.place]
        points = to_drawing(of, views.offsets)
        scale = np.exp(0.5 * of[:, 3:].sum(axis=1))
        values = _sample(self._fields[name], points / self._evidence.cell - 0.5)
        return values[0] / scale, values[1:].T / self._evidence.cell, points - of[:, :2], scale

    def _add_views(
        self,
        name: str,
        weight: float,
        states: Floats,
        sigma_m: float,
        blocks: list[tuple[Ints, Ints, Floats]],
        gradient: Floats,
    ) -> None:
        """Add the normal equations of all points of one kind, a block `(5, 5)` for each place."""
        views = self._walls if name == "wall" else self._open
        residual, slope, relative, scale = self._view_residuals(name, states)
        robust = weight / sigma_m**2 * (sigma_m**2 / (sigma_m**2 + residual**2)) ** 2
        yaw = states[views.place, 2]
        s = np.exp(states[views.place, 3:])
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = views.offsets.T
        by_yaw = slope[:, 0] * s[:, 0] * (-sin * x - cos * y) + slope[:, 1] * s[:, 1] * (cos * x - sin * y)
        jacobian = np.column_stack([slope, by_yaw, slope * relative]) / scale[:, None]
        p = len(states)
        normal = np.zeros((p, 5, 5))
        right = np.zeros((p, 5))
        for i in range(5):
            right[:, i] = np.bincount(views.place, robust * jacobian[:, i] * residual, p)
            for j in range(i, 5):
                normal[:, i, j] = np.bincount(views.place, robust * jacobian[:, i] * jacobian[:, j], p)
                normal[:, j, i] = normal[:, i, j]
        first = 5 * np.arange(p)[:, None, None]
        at = np.arange(5)
        blocks.append((first + at[:, None] + 0 * at, first + at + 0 * at[:, None], normal))
        gradient += right.ravel()

    def _edge_residuals(self, states: Floats) -> Floats:
        """Residuals `(e, 5)` of all edges in both directions, in standard deviations."""
        a, b = states[self._from], states[self._to]
        scale = np.exp(0.25 * (a[:, 3:] + b[:, 3:]).sum(axis=1))
        offset_std = OFFSET_STD_M + OFFSET_STD_PER_M * self._lengths
        gap = (b[:, :2] - to_drawing(a, self._offsets)) / (scale * offset_std)[:, None]
        root = np.sqrt(self._lengths)
        rotation = se2.wrap_angle(b[:, 2] - a[:, 2]) / (ROTATION_STD * root)
        return np.column_stack([gap, rotation, (b[:, 3:] - a[:, 3:]) / (SCALE_STD * root)[:, None]])

    def _add_edges(self, states: Floats, blocks: list[tuple[Ints, Ints, Floats]], gradient: Floats) -> None:
        """Add the normal equations of all edges, blocks `(5, 5)` of the pairs of places that they join."""
        a, b = states[self._from], states[self._to]
        residual = self._edge_residuals(states)
        groups = np.column_stack([np.hypot(*residual[:, :2].T)] * 2 + [residual[:, 2], *residual[:, 3:].T])
        weight = 1.0 / (1.0 + (groups / JUMP) ** 2)
        scale = np.exp(0.25 * (a[:, 3:] + b[:, 3:]).sum(axis=1))
        std = scale * (OFFSET_STD_M + OFFSET_STD_PER_M * self._lengths)
        cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
        x, y = self._offsets.T
        s = np.exp(a[:, 3:])
        e = len(a)
        from_a, from_b = np.zeros((e, 5, 5)), np.zeros((e, 5, 5))
        for k in range(2):
            from_b[:, k, k] = 1.0 / std
            from_a[:, k, k] = -1.0 / std
        from_a[:, 0, 2] = -s[:, 0] * (-sin * x - cos * y) / std
        from_a[:, 1, 2] = -s[:, 1] * (cos * x - sin * y) / std
        from_a[:, 0, 3] = -s[:, 0] * (cos * x - sin * y) / std
        from_a[:, 1, 4] = -s[:, 1] * (sin * x + cos * y) / std
        root = np.sqrt(self._lengths)
        for k, sigma in ((2, ROTATION_STD), (3, SCALE_STD), (4, SCALE_STD)):
            from_b[:, k, k] = 1.0 / (sigma * root)
            from_a[:, k, k] = -1.0 / (sigma * root)
        weight = EDGE_WEIGHT * weight
        at = np.arange(5)
        for left, of_left in ((from_a, self._from), (from_b, self._to)):
            weighted = left * weight[:, :, None]
            np.add.at(gradient.reshape(-1, 5), of_left, np.einsum("eki,ek->ei", weighted, residual))
            for right, of_right in ((from_a, self._from), (from_b, self._to)):
                rows = 5 * of_left[:, None, None] + at[:, None] + 0 * at
                cols = 5 * of_right[:, None, None] + at + 0 * at[:, None]
                blocks.append((rows, cols, np.einsum("eki,ekj->eij", weighted, right)))


def _slopes(field: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Slopes of a field along x and y, per cell."""
    smooth = cv2.GaussianBlur(field, (0, 0), 1.0)
    y, x = np.gradient(smooth)
    return np.asarray(x, np.float32), np.asarray(y, np.float32)


def _sample(fields: NDArray[np.float32], at: Floats) -> Floats:
    """Values `(k, n)` of fields `(k, rows, cols)` at x, y `(n, 2)` in cells, bilinear; the edge goes on outside."""
    rows, cols = fields.shape[1:]
    x, y = np.clip(at[:, 0], 0, cols - 1.001), np.clip(at[:, 1], 0, rows - 1.001)
    c, r = x.astype(np.int64), y.astype(np.int64)
    fx, fy = x - c, y - r
    f = fields
    low = f[:, r, c] * (1 - fx) + f[:, r, c + 1] * fx
    high = f[:, r + 1, c] * (1 - fx) + f[:, r + 1, c + 1] * fx
    return np.asarray(low * (1 - fy) + high * fy)
