"""Where the places of a map lie in the drawing: a particle filter over places, each with a rotation and scales of its own.

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

PARTICLES = 5000
SIGMA_M = 0.35  # of walls from where they are drawn
THINNED = 2  # every second point is used
TRANSLATION_PER_M = 0.1
ROTATION_STD, WIDE_ROTATION_STD = 0.04, 0.12  # rad per root metre
SCALE_STD, WIDE_SCALE_STD = 0.04, 0.15  # of log scales per root metre
SCALE_BOUND = 0.5  # std of a place's log scales about those of the start
SCALE_BOUND_WEIGHT = 0.05  # of that prior at each place: it is the same prior at all of them
LOOP_M = 0.4  # std of the distance at which two edges to one place may contradict each other
RESAMPLE_BELOW = 0.5
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
) -> tuple[Floats, Floats]:
    """States `(n, p, 5)` of all places for the surviving hypotheses, and their weights `(n,)`.

    `first` `(n, 5)` are states of the first place, where it is not known. Places that are known are not searched.
    """
    n, p = len(first), len(graph.centres)
    is_known = np.zeros(p, np.bool_) if known is None else known.mask
    states = [first] * p if known is None else [known.states[k] for k in range(p)]
    searched = np.flatnonzero(~is_known)
    rank = np.cumsum(~is_known) - 1  # of a searched place among them
    ancestors = np.empty((len(searched), n), np.int64)
    log_weights = np.zeros(n)
    scales = first[:, 3:].mean(axis=0)
    neighbours = graph.neighbours

    def at(place: int) -> Floats:
        """States `(n, 5)` of a placed place, or `(5,)` if it is known."""
        return states[place] if is_known[place] else states[place][ancestors[rank[place]]]

    for count, place in enumerate(searched.tolist(), 1):
        parent = int(graph.parents[place])
        if place == 0:
            states[0] = first
        else:
            parent = max(parent, 0)  # a place that no earlier one sees is predicted from the first
            before = np.broadcast_to(at(parent), (n, 5))
            states[place] = _predict(before, graph.centres[place] - graph.centres[parent], scope.wide, rng)
        ancestors[count - 1] = np.arange(n)
        here = states[place]
        log_weights += scope.view_weight * evidence.log_likelihood(
            graph.views[place][::THINNED], graph.open_views[place][::THINNED], here, SIGMA_M
        )
        log_weights -= 0.5 * (((here[:, 3:] - scales) / SCALE_BOUND) ** 2).sum(axis=1) * SCALE_BOUND_WEIGHT
        for other in neighbours[place]:
            if other != parent and (is_known[other] or other < place):
                log_weights += _loop(here, at(other), graph.centres[place] - graph.centres[other])
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        if 1.0 / (weights**2).sum() < RESAMPLE_BELOW * n:
            chosen = systematic_resampling(weights, n, rng)
            ancestors[:count] = ancestors[:count, chosen]
            log_weights = np.zeros(n)
    weights = np.exp(log_weights - log_weights.max())
    lines = np.stack([np.broadcast_to(at(k), (n, 5)) for k in range(p)], axis=1)
    return lines, weights / weights.sum()


def distinct(lines: Floats, weights: Floats, places: NDArray[np.bool_], count: int) -> list[Floats]:
    """The heaviest hypothesis and others `(p, 5)` that differ from all chosen before, at these places `(p,)`."""
    order = np.argsort(-weights, kind="stable")
    chosen: list[Floats] = []
    for index in order[:: max(len(order) // 300, 1)]:
        line = lines[index]
        scale = np.exp(line[places, 3:].mean())
        if all(
            (np.hypot(*(line - c)[places, :2].T) > DISTINCT_M * scale).sum() >= DISTINCT_PLACES
            for c in chosen
        ):
            chosen.append(line)
        if len(chosen) == count:
            break
    return chosen


def _predict(before: Floats, offset: Floats, wide_fraction: float, rng: np.random.Generator) -> Floats:
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


def _loop(here: Floats, other: Floats, offset: Floats) -> Floats:
    """Log-likelihoods `(n,)` of an edge between two places that are both placed: heavy-tailed, because drawings do not close."""
    scale = np.exp(0.25 * (here[:, 3:] + other[..., 3:]).sum(axis=1))
    gap = np.hypot(*(to_drawing(other, offset) - here[:, :2]).T) / scale
    return np.asarray(-np.log1p((gap / LOOP_M) ** 2))
