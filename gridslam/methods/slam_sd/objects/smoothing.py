"""Smoothing at the end of the log: episodes by the final poses of the key scans, and visits without a read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory
from gridslam.methods.slam_sd.objects.tag_visits import TagVisit
from gridslam.methods.slam_sd.objects.visit_evidence import KeyScanObservation

Floats = NDArray[np.float64]

MAX_HINGE_DISTANCE_M = 0.3  # largest distance between estimates of one hinge
PASSING_DISTANCE_M = 2.5  # largest distance from the robot to the centre of a leaf that it passes
MIN_GAP_NS = 2_000_000_000  # shortest time between a visit and a pass that is not part of it


def passes_without_read(
    history: ObjectHistory, scans: Sequence[KeyScanObservation], path: Floats
) -> list[TagVisit]:
    """The periods during which the robot passed an object without reading it; `path` `(k, 3)` are the key scans' poses."""
    centre = history.model.centre_at(history.episodes[-1].pose_in_map(path))
    near = np.hypot(*(path[: len(scans), :2] - centre).T) < PASSING_DISTANCE_M
    passes: list[TagVisit] = []
    was_near = False
    for scan, is_near in zip(scans, near, strict=True):
        if is_near and was_near:
            passes[-1].last_ns = scan.stamp_ns
        elif is_near:
            passes.append(TagVisit(scan.stamp_ns, scan.stamp_ns, 0))
        was_near = bool(is_near)
    return [visit for visit in passes if not any(_overlap(visit, e) for e in history.estimates)]


def episodes_of(
    estimates: Sequence[ObjectEpisode], path: Floats, differs: Callable[[Floats, Floats], bool]
) -> list[ObjectEpisode]:
    """The episodes of an object, from its estimates in the order of time, for poses `(k, 3)` of the key scans.

    An estimate that does not differ from the one before belongs to the same episode, whose pose is the more certain of the two.
    """
    episodes: list[ObjectEpisode] = []
    for estimate in estimates:
        if not episodes or differs(episodes[-1].pose_in_map(path), estimate.pose_in_map(path)):
            episodes.append(estimate)
            continue
        before = episodes[-1]
        is_better = np.linalg.det(estimate.covariance) <= np.linalg.det(before.covariance)
        episodes[-1] = replace(
            estimate if is_better else before,
            first_ns=before.first_ns,
            last_ns=estimate.last_ns,
            reads=before.reads + estimate.reads,
            gone_ns=estimate.gone_ns,
        )
    return episodes


def estimates_of_one_hinge(estimates: Sequence[ObjectEpisode], path: Floats) -> list[ObjectEpisode]:
    """The estimates of a door whose hinge agrees with that of the most often read one: hinges do not move.

    `path` `(k, 3)` holds the poses of the key scans in the map frame.
    """
    best = max(estimates, key=lambda estimate: estimate.reads).pose_in_map(path)
    return [
        estimate
        for estimate in estimates
        if float(np.hypot(*(estimate.pose_in_map(path) - best)[:2])) < MAX_HINGE_DISTANCE_M
    ]


def _overlap(visit: TagVisit, estimate: ObjectEpisode) -> bool:
    return visit.first_ns <= estimate.last_ns + MIN_GAP_NS and visit.last_ns >= estimate.first_ns - MIN_GAP_NS
