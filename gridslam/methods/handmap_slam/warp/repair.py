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

ROUNDS = 12
RADII_M = (10.0, 20.0, 40.0)  # of regions, in turn
SMOOTHING_M = 5.0
TRIED = 0.75  # factor of a place's priority after each round in which it was searched
PARTICLES = 1500
HYPOTHESES = 3


def repair(
    graph: PlaceGraph, evidence: DrawnEvidence, problem: Refinement, best: Fitted, rng: np.random.Generator
) -> list[Fitted]:
    """The best fit first, and all others that were met."""
    distances = distances_along(graph)
    near = np.exp(-0.5 * (distances / SMOOTHING_M) ** 2)
    near /= near.sum(axis=1, keepdims=True)
    priority = np.ones(len(graph.centres))
    met = []
    for count in range(ROUNDS):
        centre = int(np.argmax(near @ problem.place_costs(best.states) * priority))
        region = distances[centre] < RADII_M[count % len(RADII_M)]
        priority[region] *= TRIED
        lines, weights = find_places(
            graph, evidence, np.repeat(best.states[:1], PARTICLES, axis=0), rng, Known(~region, best.states)
        )
        fits = [problem.fit(line, region) for line in distinct(lines, weights, region, HYPOTHESES)]
        met += fits
        found = min(fits, key=lambda fit: fit.cost)
        if found.cost < best.cost:
            met.append(best)
            best = problem.fit(found.states)
    return [best, *met]


def distances_along(graph: PlaceGraph) -> Floats:
    """Distances `(p, p)` (m) along the edges."""
    a, b = graph.edges.T
    lengths = np.maximum(np.hypot(*(graph.centres[a] - graph.centres[b]).T), 1e-3)
    p = len(graph.centres)
    return np.asarray(dijkstra(coo_matrix((lengths, (a, b)), shape=(p, p)).tocsr(), directed=False))
