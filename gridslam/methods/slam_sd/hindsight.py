"""What is known at the end of the log and was not at the moment: better poses of the key scans, and where doors hinge."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.evidence import SeenScan
from gridslam.methods.slam_sd.stays import Stay, TrackedObject
from gridslam.methods.slam_sd.visits import Visit

Floats = NDArray[np.float64]

HINGE_APART_M = 0.3
PASS_M = 2.5  # from the lidar to the middle of the leaf
APART_NS = 2_000_000_000  # between a visit and a pass that is not part of it


def unread_passes(found: TrackedObject, scans: Sequence[SeenScan], path: Floats) -> list[Visit]:
    """The spells during which the robot was near an object that was found at other times; visits without reads."""
    pose = found.stays[-1].placed(path)
    middle = se2.transform_points(pose, found.thing.centre[None])[0]
    near = np.hypot(*(path[: len(scans), :2] - middle).T) < PASS_M
    passes: list[Visit] = []
    was_near = False
    for seen, is_near in zip(scans, near, strict=True):
        if is_near and was_near:
            passes[-1].last_ns = seen.stamp_ns
        elif is_near:
            passes.append(Visit(seen.stamp_ns, seen.stamp_ns, 0))
        was_near = bool(is_near)
    return [visit for visit in passes if not any(_overlap(visit, stay) for stay in found.seen)]


def stays_of(seen: Sequence[Stay], path: Floats, differs: Callable[[Floats, Floats], bool]) -> list[Stay]:
    """The places where an object stood, from its estimates in the order of time.

    An estimate that does not differ from the one before, in the map of these poses `(k, 3)`, tells of the same place; the
    better of the two says where it is.
    """
    stays: list[Stay] = []
    for stay in seen:
        if not stays or differs(stays[-1].placed(path), stay.placed(path)):
            stays.append(stay)
            continue
        before = stays[-1]
        better = stay if np.linalg.det(stay.covariance) <= np.linalg.det(before.covariance) else before
        stays[-1] = replace(
            better,
            first_ns=before.first_ns,
            last_ns=stay.last_ns,
            reads=before.reads + stay.reads,
            gone_ns=stay.gone_ns,
        )
    return stays


def hinged_alike(seen: Sequence[Stay], path: Floats) -> list[Stay]:
    """Those estimates of a door whose hinge is where that of the most often read one is: hinges do not move."""
    best = max(seen, key=lambda stay: stay.reads).placed(path)
    return [stay for stay in seen if float(np.hypot(*(stay.placed(path) - best)[:2])) < HINGE_APART_M]


def _overlap(visit: Visit, stay: Stay) -> bool:
    return visit.first_ns <= stay.last_ns + APART_NS and visit.last_ns >= stay.first_ns - APART_NS
