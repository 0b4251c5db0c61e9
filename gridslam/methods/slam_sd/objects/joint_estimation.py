"""Joint estimation of objects beside each other: a beam is explained by one object only.

The paper reports a failure: a small door was reported on the outside of a bin beside it. The log likelihood ratio of two
objects is that of one alone plus that of the other given the first. The result must not depend on which one comes first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.slam_sd.objects.object_filter import ObjectFilter, ObjectPosterior
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.pose_prior import PriorEstimate
from gridslam.methods.slam_sd.objects.visit_evidence import VisitEvidence

Floats = NDArray[np.float64]

MAX_GAP_M = 1.0  # largest distance between objects that may explain the same beams
MIN_LOST_GAIN = 3.0  # log likelihood ratio that a neighbour loses before it is located again


@dataclass(frozen=True, slots=True)
class VisitedObject:
    """An object with the evidence of a visit and its earlier estimate."""

    model: ObjectModel
    evidence: VisitEvidence
    earlier: PriorEstimate | None

    def filter(self, footprints: Sequence[Floats], settings: ObjectSettings) -> ObjectFilter:
        """The object's filter, without the beams that the footprints `(k, 2)` of other objects explain."""
        return ObjectFilter(self.model, self.evidence.explained_by(footprints), self.earlier, settings)


@dataclass(frozen=True, slots=True)
class LocatedObject:
    """A visited object and its estimated pose."""

    visited: VisitedObject
    posterior: ObjectPosterior

    @property
    def corners(self) -> Floats:
        """Corners `(k, 2)` of its footprint."""
        return self.visited.model.corners_at(self.posterior.pose)

    @property
    def centre(self) -> Floats:
        """Centre (2,) of its footprint."""
        return self.visited.model.centre_at(self.posterior.pose)


def locate_jointly(
    visited: VisitedObject,
    neighbours: Mapping[str, LocatedObject],
    footprints: Sequence[Floats],
    settings: ObjectSettings,
    rng: np.random.Generator,
) -> tuple[ObjectPosterior, dict[str, ObjectPosterior]]:
    """The pose of a visited object, and new poses of the neighbours that it displaces.

    `neighbours` are objects whose evidence is available; `footprints` `(k, 2)` are those of objects with a known pose only.
    First the object explains only what its neighbours leave. Then it explains all that it can, and neighbours that lose beams
    are located again. The alternative with the higher posterior is returned.
    """
    corners = {name: other.corners for name, other in neighbours.items()}
    after_others = visited.filter([*footprints, *corners.values()], settings).locate(rng)
    model, centre = visited.model, visited.model.centre_at(after_others.pose)
    close = {
        name: other
        for name, other in neighbours.items()
        if float(np.hypot(*(other.centre - centre)))
        < MAX_GAP_M + model.radius_m + other.visited.model.radius_m
    }
    if not settings.objects.is_joint or not close:
        return after_others, {}
    before_others = visited.filter(footprints, settings).locate(rng)
    own_corners = model.corners_at(before_others.pose)
    displaced = {
        name: other
        for name, other in close.items()
        if _lost_gain(other, footprints, own_corners, settings) > MIN_LOST_GAIN
    }
    if not displaced:
        return after_others, {}
    total_after, total_before = after_others.log_posterior, before_others.log_posterior
    moved: dict[str, ObjectPosterior] = {}
    taken = [*footprints, own_corners, *(corners[name] for name in close if name not in displaced)]
    for name, other in displaced.items():
        total_after += other.visited.filter(footprints, settings).log_posterior(other.posterior.pose)
        moved[name] = other.visited.filter(taken, settings).locate(rng)
        total_before += moved[name].log_posterior
        taken.append(other.visited.model.corners_at(moved[name].pose))
    return (before_others, moved) if total_before > total_after else (after_others, {})


def _lost_gain(
    other: LocatedObject, footprints: Sequence[Floats], corners: Floats, settings: ObjectSettings
) -> float:
    """Log likelihood ratio that an object loses if `corners` `(k, 2)` explain their beams first."""
    pose = other.posterior.pose
    before = other.visited.filter(footprints, settings).log_likelihood_ratio(pose)
    after = other.visited.filter([*footprints, corners], settings).log_likelihood_ratio(pose)
    return before - after
