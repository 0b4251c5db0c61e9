"""All places together: robust least squares over their states, coarse to fine, with smoothness between neighbours.

A place that the drawing lacks has no wall within range, so its costs are constant and its neighbours alone place it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.kernels.drawings.stretched_edges import PlaceEdges, add_edge_equations, edge_residuals
from gridslam.kernels.drawings.stretched_places import NormalEquations, PlacePoints, normal_equations
from gridslam.methods.handmap_slam.warp.block_matrix import BlockMatrix
from gridslam.methods.handmap_slam.warp.contradictions import DrawingContradictions
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

SIGMAS_M = (0.7, 0.45, 0.3)  # standard deviations of walls from where they are drawn, coarse to fine
ITERATIONS = 6  # number of iterations at each of them
WALL_WEIGHT, OPEN_WEIGHT = 0.25, 0.15  # weights of a point: neighbouring points and places see the same walls
# Standard deviation of a place from where its neighbour expects it
OFFSET_STD_PER_M, OFFSET_STD_M = 0.12, 0.05
ROTATION_STD, SCALE_STD = 0.07, 0.08  # standard deviations between neighbours, per root metre
ASPECT_STD, ASPECT_WEIGHT = 0.5, 0.1  # prior on the difference of a place's log scales
ASPECT_INFORMATION = ASPECT_WEIGHT / ASPECT_STD**2 * np.outer([0, 0, 0, 1, -1], [0, 0, 0, 1, -1])
MIN_LENGTH_M = 0.3  # smallest length of an edge where a variance is proportional to it
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
        """Mean cost of a place: low if the map's walls lie on drawn ones."""
        return float(self.place_costs.mean())

    @property
    def cost(self) -> float:
        """Total cost, by which fits are compared."""
        return float(self.place_costs.sum()) + self.contradictions


def _points(pieces: list[Floats]) -> PlacePoints:
    """The points of all places in one array."""
    starts = offsets_of(map(len, pieces))
    return PlacePoints(np.ascontiguousarray(np.concatenate([*pieces, np.zeros((0, 2))])), starts)


class Refinement:
    """The problem for one map and one drawing."""

    def __init__(
        self, graph: PlaceGraph, evidence: DrawnEvidence, fields: dict[str, NDArray[np.float32]] | None = None
    ) -> None:
        self._graph = graph
        self._damping = np.full(5 * len(graph.centres), PRIOR_DAMPING)
        self._evidence = evidence
        self._contradictions = DrawingContradictions(graph, evidence)
        self._points = (
            ("wall", WALL_WEIGHT, _points(graph.views)),
            ("open", OPEN_WEIGHT, _points(graph.open_views)),
        )
        self._fields = fields or {
            name: sloped_field(field)
            for name, field in (("wall", evidence.to_wall), ("open", evidence.to_free))
        }
        self._edges = _edges_of(graph)
        places = np.arange(len(graph.centres))
        ends = self._edges.ends
        self._matrix = BlockMatrix(
            len(places),
            np.concatenate(
                [np.column_stack([places, places]), *(ends[:, [i, j]] for i in range(2) for j in range(2))]
            ),
        )

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
        squares = (edge_residuals(self._edges, states) / JUMP) ** 2
        costs = EDGE_WEIGHT * 0.5 * JUMP**2 * np.log1p(squares).sum(axis=1)
        return np.asarray(np.bincount(self._edges.ends.ravel(), np.repeat(0.5 * costs, 2), len(states)))

    def folded(self, states: Floats) -> Mask:
        """Mask `(p,)` of the places in whose free space another part of the map lies in the drawing."""
        return self._contradictions.folded(states)

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
        gradient = np.zeros((len(states), 5))
        own = damping.reshape(-1, 5, 1) * np.eye(5) + ASPECT_INFORMATION
        for weight, equations in self._view_equations(states, sigma_m):
            own += weight * equations.matrix
            gradient += weight * equations.gradient
        blocks = add_edge_equations(self._edges, states, JUMP, EDGE_WEIGHT, gradient)
        gradient += states @ ASPECT_INFORMATION
        values = np.concatenate([own, *(blocks[:, i, j] for i in range(2) for j in range(2))])
        step = -self._matrix.solve(values, gradient.ravel()).reshape(-1, 5)
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


def _edges_of(graph: PlaceGraph) -> PlaceEdges:
    """The edges of a graph in both directions, with what a drawing may change along each."""
    ends = np.concatenate([graph.edges, graph.edges[:, ::-1]])
    offsets = graph.centres[ends[:, 1]] - graph.centres[ends[:, 0]]
    lengths = np.maximum(np.hypot(*offsets.T), MIN_LENGTH_M)
    root = np.sqrt(lengths)
    return PlaceEdges(
        np.ascontiguousarray(ends),
        offsets,
        offset_std_m=OFFSET_STD_M + OFFSET_STD_PER_M * lengths,
        rotation_std=ROTATION_STD * root,
        scale_std=SCALE_STD * root,
    )


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


def sloped_field(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """A field `(rows, cols)` with its slopes along x and y per cell, `(rows, cols, 3)`."""
    smooth = cv2.GaussianBlur(field, (0, 0), 1.0)
    y, x = np.gradient(smooth)
    return np.stack([field, np.asarray(x, np.float32), np.asarray(y, np.float32)], axis=-1)
