"""Objects beside each other, located jointly: a beam is explained by one object only.

The paper reports a failure: a small door reported on the outside of a bin beside it. The log likelihood ratio of two
objects is that of one alone plus that of the other given the first; which one comes first must not decide where they end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.evidence import Evidence
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.object_filter import ObjectFilter, Posterior
from gridslam.methods.slam_sd.object_prior import Known
from gridslam.methods.slam_sd.things import Thing

Floats = NDArray[np.float64]

APART_M = 1.0  # between objects beyond which they do not dispute beams
LEAST_DISPUTED = 3.0  # log likelihood ratio that a neighbour loses before it is located again


@dataclass(frozen=True, slots=True)
class Candidate:
    """An object with the evidence of its last visit, what was known before it, and its pose (3,) found so far."""

    thing: Thing
    evidence: Evidence
    known: Known | None
    posterior: Posterior

    def filter(self, outlines: Sequence[Floats], config: ObjectsConfig) -> ObjectFilter:
        """Its filter when these outlines `(k, 2)` explain their beams first."""
        return ObjectFilter(self.thing, self.evidence.explained_by(outlines), self.known, config)


def locate_beside(
    thing: Thing,
    evidence: Evidence,
    known: Known | None,
    neighbours: Mapping[str, Candidate],
    standing: Sequence[Floats],
    config: ObjectsConfig,
    rng: np.random.Generator,
) -> tuple[Posterior, dict[str, Posterior]]:
    """Where a new object is, and where those of its neighbours are that must give way.

    `neighbours` are objects whose evidence is at hand, `standing` `(k, 2)` outlines of those of which only the place is known.
    First the new one takes what the neighbours leave; then it takes what it likes, and the neighbours whose beams it took are
    located again. What explains more stands.
    """
    placed = {name: c.thing.placed(c.posterior.pose) for name, c in neighbours.items()}
    given = [*standing, *placed.values()]
    last = ObjectFilter(thing, evidence.explained_by(given), known, config).locate(rng)
    middle = _middle(thing, last)
    neighbours = {
        name: c
        for name, c in neighbours.items()
        if float(np.hypot(*(_middle(c.thing, c.posterior) - middle)))
        < APART_M + thing.radius_m + c.thing.radius_m
    }
    if not config.joint or not neighbours:
        return last, {}
    first = ObjectFilter(thing, evidence.explained_by(standing), known, config).locate(rng)
    corners = thing.placed(first.pose)
    disputed = {
        name: c
        for name, c in neighbours.items()
        if c.filter(standing, config).judge(c.posterior.pose)
        - c.filter([*standing, corners], config).judge(c.posterior.pose)
        > LEAST_DISPUTED
    }
    if not disputed:
        return last, {}
    total_before, total_after = last.log_posterior, first.log_posterior
    moved: dict[str, Posterior] = {}
    taken = [*standing, corners, *(placed[n] for n in neighbours if n not in disputed)]
    for name, candidate in disputed.items():
        total_before += candidate.filter(standing, config).weigh(candidate.posterior.pose)
        moved[name] = candidate.filter(taken, config).locate(rng)
        total_after += moved[name].log_posterior
        taken.append(candidate.thing.placed(moved[name].pose))
    return (first, moved) if total_after > total_before else (last, {})


def _middle(thing: Thing, posterior: Posterior) -> Floats:
    return np.asarray(se2.transform_points(posterior.pose, thing.centre[None])[0])
