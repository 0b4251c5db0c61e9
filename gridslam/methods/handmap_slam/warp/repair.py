"""Regions of the map whose places fit badly are searched again, with the rest held where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence
from gridslam.methods.handmap_slam.warp.places import PlaceGraph
from gridslam.methods.handmap_slam.warp.refinement import Fitted, Refinement
from gridslam.methods.handmap_slam.warp.search import Known, distinct, find_places

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDS = 12
RADII_M = (10.0, 20.0, 40.0)  # of regions, in turn
SMOOTHING_M = 5.0
TRIED = 0.75  # factor of a place's priority after each round in which it was searched
PARTICLES = 1500
HYPOTHESES = 3
DIFFERS_M = 1.0  # a place lies elsewhere in two fits that are this far apart
MARGIN_M = 3.0  # about places that lie elsewhere, in which costs may differ too


class Repair:
    """The best fit so far, and how much worse each place's best alternative is.

    `alternative` `(p,)` is the additional cost of a place, mean over all that lie elsewhere with it; infinite where none was met.
    """

    def __init__(
        self,
        graph: PlaceGraph,
        evidence: DrawnEvidence,
        problem: Refinement,
        best: Fitted,
        rng: np.random.Generator,
    ) -> None:
        self._graph, self._evidence, self._problem, self._rng = graph, evidence, problem, rng
        self._distances = distances_along(graph)
        self._near = smoothing(self._distances, SMOOTHING_M)
        self._met: list[Floats] = []
        self.best = best
        self._costs = problem.place_costs(best.states)
        self._search()
        self.alternative = self._alternatives()

    def _search(self) -> None:
        priority = np.ones(len(self._costs))
        for count in range(ROUNDS):
            centre = int(np.argmax(self._near @ self._costs * priority))
            region = self._distances[centre] < RADII_M[count % len(RADII_M)]
            priority[region] *= TRIED
            fits = self._search_again(region)
            self._met += [fit.states for fit in fits]
            found = min(fits, key=lambda fit: fit.cost)
            if found.cost < self.best.cost:
                self._take(found.states)

    def _take(self, states: Floats) -> None:
        """Refine all places of a better fit."""
        self._met.append(self.best.states)
        self.best = self._problem.fit(states)
        self._costs = self._problem.place_costs(self.best.states)

    def _search_again(self, region: Mask) -> list[Fitted]:
        """Other fits, in which the places of a region are placed anew."""
        states = self.best.states
        first = np.repeat(states[:1], PARTICLES, axis=0)
        lines, weights = find_places(
            self._graph, self._evidence, first, self._rng, Known(~region, states)
        )
        return [self._problem.fit(line, region) for line in distinct(lines, weights, region, HYPOTHESES)]

    def _elsewhere(self, states: Floats) -> tuple[Mask, Mask]:
        """Which places lie elsewhere than in the best fit, and these with all around them."""
        best = self.best.states
        scales = np.exp(best[:, 3:].mean(axis=1))
        elsewhere = np.hypot(*(states - best)[:, :2].T) > DIFFERS_M * scales
        around = elsewhere | (self._distances[elsewhere] < MARGIN_M).any(axis=0)
        return elsewhere, around

    def _alternatives(self) -> Floats:
        least = np.full(len(self._costs), np.inf)
        for states in self._met:
            elsewhere, around = self._elsewhere(states)
            if elsewhere.any():
                more = (self._problem.place_costs(states) - self._costs)[around].sum() / elsewhere.sum()
                least[elsewhere] = np.minimum(least[elsewhere], more)
        return least


def smoothing(distances: Floats, std_m: float) -> Floats:
    """Weights `(p, p)` of the mean over the places around each."""
    near = np.exp(-0.5 * (distances / std_m) ** 2)
    return np.asarray(near / near.sum(axis=1, keepdims=True))


def distances_along(graph: PlaceGraph) -> Floats:
    """Distances `(p, p)` (m) along the edges."""
    a, b = graph.edges.T
    lengths = np.maximum(np.hypot(*(graph.centres[a] - graph.centres[b]).T), 1e-3)
    p = len(graph.centres)
    return np.asarray(dijkstra(coo_matrix((lengths, (a, b)), shape=(p, p)).tocsr(), directed=False))
