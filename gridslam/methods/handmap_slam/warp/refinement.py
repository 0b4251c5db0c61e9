"""All places together: robust least squares over their states, coarse to fine, with smoothness between neighbours.

A place that the drawing lacks has no wall within range, so its costs are constant and its neighbours alone place it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from gridslam.core import poses as se2
from gridslam.kernels.stretched_places import NormalEquations, PlacePoints, normal_equations
from gridslam.methods.handmap_slam.warp.contradictions import Contradictions
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

SIGMAS_M = (0.7, 0.45, 0.3)  # of walls from where they are drawn, coarse to fine
ITERATIONS = 6  # at each
WALL_WEIGHT, OPEN_WEIGHT = 0.25, 0.15  # of a point: neighbouring points and places see the same walls
OFFSET_STD_PER_M, OFFSET_STD_M = 0.12, 0.05  # of a place from where its neighbour expects it
ROTATION_STD, SCALE_STD = 0.07, 0.08  # per root metre between neighbours
ASPECT_STD, ASPECT_WEIGHT = 0.5, 0.1  # of the difference of a place's log scales
EDGE_WEIGHT = 0.5  # each edge is there in both directions
JUMP = 3.0  # residuals beyond this many standard deviations weigh ever less
PRIOR_DAMPING, FIXED_DAMPING = 1e-6, 1e9
STEP_LIMITS = np.array([0.5, 0.5, 0.15, 0.1, 0.1])  # metres, rad, log scales


@dataclass(frozen=True)
class Fitted:
    """States `(p, 5)` of the places, their costs `(p,)` (minus log-likelihood of views and edges), and that of contradictions."""

    states: Floats
    place_costs: Floats
    contradictions: float

    @property
    def cost_per_place(self) -> float:
        """How well the map's walls lie on drawn ones."""
        return float(self.place_costs.mean())

    @property
    def cost(self) -> float:
        """By which fits are compared."""
        return float(self.place_costs.sum()) + self.contradictions


def _points(pieces: list[Floats]) -> PlacePoints:
    """The points of all places in one array."""
    starts = np.concatenate([[0], np.cumsum([len(v) for v in pieces])]).astype(np.int64)
    return PlacePoints(np.ascontiguousarray(np.concatenate([*pieces, np.zeros((0, 2))])), starts)


class Refinement:
    """The problem for one map and one drawing."""

    def __init__(
        self, graph: PlaceGraph, evidence: DrawnEvidence, fields: dict[str, NDArray[np.float32]] | None = None
    ) -> None:
        self._graph = graph
        self._damping = np.full(5 * len(graph.centres), PRIOR_DAMPING)
        self._evidence = evidence
        self._contradictions = Contradictions(graph, evidence)
        self._points = (
            ("wall", WALL_WEIGHT, _points(graph.views)),
            ("open", OPEN_WEIGHT, _points(graph.open_views)),
        )
        self._fields = fields or {
            name: np.stack([field, *_slopes(field)])
            for name, field in (("wall", evidence.to_wall), ("open", evidence.to_free))
        }
        both = np.concatenate([graph.edges, graph.edges[:, ::-1]])
        self._from, self._to = both[:, 0], both[:, 1]
        self._offsets = graph.centres[self._to] - graph.centres[self._from]
        self._lengths = np.maximum(np.hypot(*self._offsets.T), 0.3)

    def fit(self, states: Floats, free: Mask | None = None) -> Fitted:
        """Improve states `(p, 5)`: all of them, or those of the places that are `free` `(p,)`."""
        states = states.copy()
        if free is None:
            self._improve(states, self._damping)
        else:
            region = _around(self._graph, free)
            part = states[region]
            damping = np.where(np.repeat(free[region], 5), PRIOR_DAMPING, FIXED_DAMPING)
            Refinement(_part_of(self._graph, region, free), self._evidence, self._fields)._improve(
                part, damping
            )
            states[free] = part[free[region]]
        return self.fitted(states)

    def fitted(self, states: Floats) -> Fitted:
        """States `(p, 5)` as they are, with their costs."""
        return Fitted(states, self.place_costs(states), self._contradictions.cost(states))

    def place_costs(self, states: Floats) -> Floats:
        """Costs `(p,)`: truncated squares of a place's views, and half the heavy-tailed costs of its edges."""
        p = len(states)
        costs = np.zeros(p)
        for weight, equations in self._view_equations(states, SIGMAS_M[-1]):
            costs += weight * equations.cost
        return np.asarray(costs + self.deformation_costs(states))

    def deformation_costs(self, states: Floats) -> Floats:
        """The part `(p,)` of the costs that is for edges: what the drawing changes from a place to its neighbours."""
        p = len(states)
        edges = EDGE_WEIGHT * 0.5 * JUMP**2 * np.log1p((self._edge_residuals(states) / JUMP) ** 2).sum(axis=1)
        return np.asarray(0.5 * (np.bincount(self._from, edges, p) + np.bincount(self._to, edges, p)))

    def min_information(self, states: Floats) -> Floats:
        """The information on the position that the walls about each place give, `(p,)` in 1 / m^2, in its weakest direction."""
        weight, equations = self._view_equations(states, SIGMAS_M[-1])[0]
        per_m2 = weight * np.exp(states[:, 3:].sum(axis=1))[:, None, None]
        return np.asarray(np.linalg.eigvalsh(per_m2 * equations.matrix[:, :2, :2])[:, 0])

    def _improve(self, states: Floats, damping: Floats) -> None:
        for sigma_m in SIGMAS_M:
            for _ in range(ITERATIONS):
                states[:] = self._step(states, sigma_m, damping)

    def _step(self, states: Floats, sigma_m: float, damping: Floats) -> Floats:
        """States after one Gauss-Newton step, limited to `STEP_LIMITS`."""
        n = 5 * len(states)
        blocks: list[tuple[Ints, Ints, Floats]] = []
        gradient = np.zeros(n)
        first = 5 * np.arange(len(states))
        at = np.arange(5)
        rows, cols = first[:, None, None] + at[:, None] + 0 * at, first[:, None, None] + at + 0 * at[:, None]
        for weight, equations in self._view_equations(states, sigma_m):
            blocks.append((rows, cols, weight * equations.matrix))
            gradient += weight * equations.gradient.ravel()
        self._add_edges(states, blocks, gradient)
        aspect = states[:, 3] - states[:, 4]
        first = first + 3
        w = ASPECT_WEIGHT / ASPECT_STD**2
        for a, b, v in ((0, 0, w), (1, 1, w), (0, 1, -w), (1, 0, -w)):
            blocks.append((first + a, first + b, np.full(len(first), v)))
        gradient[first] += w * aspect
        gradient[first + 1] -= w * aspect
        rows, cols, values = (np.concatenate([b[k].ravel() for b in blocks]) for k in range(3))
        diagonal = np.arange(n)
        matrix = coo_matrix(
            (
                np.concatenate([values, damping]),
                (np.concatenate([rows, diagonal]), np.concatenate([cols, diagonal])),
            ),
            shape=(n, n),
        ).tocsc()
        step = -spsolve(matrix, gradient).reshape(-1, 5)
        scale = np.exp(0.5 * states[:, 3:].sum(axis=1))
        limits = STEP_LIMITS * np.column_stack([scale, scale, *np.ones((3, len(scale)))])
        states = states + np.clip(step, -limits, limits)
        states[:, 2] = se2.wrap_angle(states[:, 2])
        return states

    def _view_equations(self, states: Floats, sigma_m: float) -> list[tuple[float, NormalEquations]]:
        """Weights and normal equations of both kinds of points."""
        return [
            (weight, normal_equations(self._fields[name], self._evidence.cell, points, states, sigma_m))
            for name, weight, points in self._points
        ]

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


def _around(graph: PlaceGraph, free: Mask) -> Ints:
    """The numbers of the free places and of their neighbours."""
    chosen = free.copy()
    a, b = graph.edges.T
    chosen[a[free[b]]] = True
    chosen[b[free[a]]] = True
    return np.flatnonzero(chosen)


def _part_of(graph: PlaceGraph, region: Ints, free: Mask) -> PlaceGraph:
    """The graph of a region, with the views of its free places and their edges."""
    number = np.full(len(free), -1)
    number[region] = np.arange(len(region))
    kept = graph.edges[free[graph.edges].any(axis=1)]
    none = np.zeros((0, 2))
    return replace(
        graph,
        centres=graph.centres[region],
        edges=number[kept],
        views=[graph.views[k] if free[k] else none for k in region],
        open_views=[graph.open_views[k] if free[k] else none for k in region],
    )


def _slopes(field: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Slopes of a field along x and y, per cell."""
    smooth = cv2.GaussianBlur(field, (0, 0), 1.0)
    y, x = np.gradient(smooth)
    return np.asarray(x, np.float32), np.asarray(y, np.float32)
