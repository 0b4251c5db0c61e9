"""Search for the places of a map in the drawing: a particle filter over places, each with its own rotation and scales.

A particle is a hypothesis for all places so far. A place is predicted from the earlier place that it was entered from, not from
the one before in time, so what went wrong in a room that the drawing lacks has no effect on the corridor behind its door.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]

PARTICLES = 5000  # each is a hypothesis for all places
SIGMA_M = 0.35  # standard deviation of walls from where they are drawn
THINNED = 2  # every second point is used
# Std of a place's offset from the place it was entered from, as a fraction of their distance
TRANSLATION_PER_M = 0.1
ROTATION_STD, WIDE_ROTATION_STD = 0.04, 0.12  # standard deviations of the rotation, rad per root metre
SCALE_STD, WIDE_SCALE_STD = 0.04, 0.15  # standard deviations of log scales per root metre
# Fraction of the particles that draw what follows at another scale, and the std of the change of its log scales
RESCALED, RESCALED_STD = 0.1, 0.4
SCALE_BOUND = 0.5  # std of a place's log scales about those of the start
SCALE_BOUND_WEIGHT = 0.05  # weight of that prior at each place: it is the same prior at all of them
LOOP_M = 0.4  # std of the distance at which two edges to one place may contradict each other
CROSSED = 1.5  # log-likelihood lost by a drawn wall between a place and the one from which it was entered
RESAMPLE_BELOW = 0.5  # fraction of the particles; below it the effective sample size is too small
RETURNED = 300  # largest number of hypotheses that are returned
DISTINCT_M, DISTINCT_PLACES = 1.5, 8  # two hypotheses differ if this many places are this far apart


class Scope(NamedTuple):
    """The power of a point's likelihood, and the fraction of particles that expect another scale and direction from here on."""

    view_weight: float
    wide: float


CAREFUL, WIDE = Scope(0.05, 0.25), Scope(0.03, 0.5)


@dataclass(frozen=True)
class Known:
    """Places `(p,)` whose states, rows of `(p, 5)`, are known."""

    mask: NDArray[np.bool_]
    states: Floats


def find_places(
    graph: PlaceGraph,
    evidence: DrawnEvidence,
    first: Floats,
    rng: np.random.Generator,
    known: Known | None = None,
    *,
    scope: Scope = CAREFUL,
) -> Floats:
    """States `(m, p, 5)` of all places for some of the surviving hypotheses, the most probable first.

    `graph` holds the places and the edges between them, `evidence` the likelihood of a place, and `scope` the caution of the
    search. `first` `(n, 5)` are states of the first place, where it is not known. Places that are `known` are not searched.
    `rng` draws the particles.
    """
    n, p = len(first), len(graph.centres)
    known = known or Known(np.zeros(p, np.bool_), np.zeros((p, 5)))
    lineage = PlaceLineage(graph, known, n)
    log_weights = np.zeros(n)
    scales = first[:, 3:].mean(axis=0)
    for place in np.flatnonzero(~known.mask).tolist():
        parent = int(graph.parents[place])
        if place == 0:
            here = first
        else:
            parent = max(parent, 0)  # a place that no earlier one sees is predicted from the first
            offset = graph.centres[place] - graph.centres[parent]
            before = np.broadcast_to(lineage.at(parent), (n, 5))
            here = predict_place(rescaled(before, rng), offset, scope.wide, rng)
            log_weights -= CROSSED * evidence.crossed(before[:, :2], here[:, :2])
        lineage.add(place, here)
        log_weights += scope.view_weight * evidence.log_likelihood(
            graph.views[place][::THINNED], graph.open_views[place][::THINNED], here, SIGMA_M
        )
        log_weights -= 0.5 * (((here[:, 3:] - scales) / SCALE_BOUND) ** 2).sum(axis=1) * SCALE_BOUND_WEIGHT
        for other in graph.neighbours[place]:
            if other != parent and (known.mask[other] or other < place):
                log_weights += loop_likelihood(
                    here, lineage.at(other), graph.centres[place] - graph.centres[other]
                )
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        if 1.0 / (weights**2).sum() < RESAMPLE_BELOW * n:
            lineage.resample(systematic_resampling(weights, n, rng))
            log_weights = np.zeros(n)
    order = np.argsort(-log_weights, kind="stable")
    return lineage.lines(order[:: max(n // RETURNED, 1)])


class PlaceLineage:
    """The states of all places for each particle, as they were drawn, and which particles of then became those of now."""

    def __init__(self, graph: PlaceGraph, known: Known, particles: int) -> None:
        self._known = known
        self._last_use = np.array([max(near, default=-1) for near in graph.neighbours])
        self._drawn: dict[int, Floats] = {}
        # Of the particles of now, for places that are still needed.
        self._ancestors: dict[int, NDArray[np.int64]] = {}
        self._chosen: dict[int, NDArray[np.int64]] = {}
        self._itself = np.arange(particles)
        self._newest = 0

    def add(self, place: int, states: Floats) -> None:
        """States `(n, 5)` of one more place, later than all before."""
        self._drawn[place], self._ancestors[place], self._newest = states, self._itself, place

    def at(self, place: int) -> Floats:
        """States `(n, 5)` of a place that was added, or `(5,)` if it is known."""
        if self._known.mask[place]:
            return np.asarray(self._known.states[place])
        return np.asarray(self._drawn[place][self._ancestors[place]])

    def resample(self, chosen: NDArray[np.int64]) -> None:
        """Go on with the particles `chosen` `(n,)`."""
        self._chosen[self._newest] = chosen
        self._ancestors = {
            place: ancestors[chosen]
            for place, ancestors in self._ancestors.items()
            if place == 0 or self._last_use[place] > self._newest
        }

    def lines(self, particles: NDArray[np.int64]) -> Floats:
        """States `(m, p, 5)` of all places for particles `(m,)`."""
        lines = np.repeat(self._known.states[None], len(particles), axis=0)
        for place, states in reversed(self._drawn.items()):
            if place in self._chosen:
                particles = self._chosen[place][particles]
            lines[:, place] = states[particles]
        return lines


def distinct(lines: Floats, places: NDArray[np.bool_], count: int) -> list[Floats]:
    """The first hypothesis and others `(p, 5)` that differ from all chosen before, at these places `(p,)`."""
    chosen: list[Floats] = []
    for line in lines:
        scale = np.exp(line[places, 3:].mean())
        if all(
            (np.hypot(*(line - c)[places, :2].T) > DISTINCT_M * scale).sum() >= DISTINCT_PLACES
            for c in chosen
        ):
            chosen.append(line)
        if len(chosen) == count:
            break
    return chosen


def predict_place(before: Floats, offset: Floats, wide_fraction: float, rng: np.random.Generator) -> Floats:
    """States `(n, 5)` at an offset `(2,)` (m) from places in states `(n, 5)`."""
    n = len(before)
    distance = float(np.hypot(*offset))
    wide = rng.permutation(np.arange(n) < wide_fraction * n)
    noise = rng.standard_normal((n, 5))
    root = np.sqrt(distance)
    after = before.copy()
    half_rotated = before.copy()
    rotation = root * np.where(wide, WIDE_ROTATION_STD, ROTATION_STD) * noise[:, 2]
    scale_std = root * np.where(wide, WIDE_SCALE_STD, SCALE_STD)
    half_rotated[:, 2] += 0.5 * rotation
    half_rotated[:, 3:] += scale_std[:, None] * noise[:, 3:]
    moved = offset + TRANSLATION_PER_M * distance * noise[:, :2]
    after[:, :2] = to_drawing(half_rotated, moved)
    after[:, 2] = se2.wrap_angle(before[:, 2] + rotation)
    after[:, 3:] = half_rotated[:, 3:]
    return after


def rescaled(states: Floats, rng: np.random.Generator) -> Floats:
    """States `(n, 5)`, some with very different scales: a room may be drawn at half the scale of the corridor before it."""
    changed = rng.random(len(states)) < RESCALED
    after = states.copy()
    after[changed, 3:] += RESCALED_STD * rng.standard_normal((int(changed.sum()), 2))
    return after


def loop_likelihood(here: Floats, other: Floats, offset: Floats) -> Floats:
    """Log-likelihoods `(n,)` of an edge between two places that are both placed: heavy-tailed, because drawings do not close."""
    scale = np.exp(0.25 * (here[:, 3:] + other[..., 3:]).sum(axis=1))
    gap = np.hypot(*(to_drawing(other, offset) - here[:, :2]).T) / scale
    return np.asarray(-np.log1p((gap / LOOP_M) ** 2))
