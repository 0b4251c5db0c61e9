"""Objects that were found more than once tie the path: weights of the particles, edges for the graph of the final stage.

A box that has not moved ties both poses of the robot rigidly. A door may have turned, but its hinge has not moved: it ties the
positions only. What has moved ties nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges
from gridslam.methods.slam_sd.stays import Stay, TrackedObject, turned

Floats = NDArray[np.float64]

LEAST_DEVIATIONS = np.array([0.01, 0.01, 0.01])  # of an estimate within its visit's scans
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def landmark_edges(objects: Iterable[TrackedObject], path: Floats) -> Edges:
    """Edges between the key scans from which an object was found at the same place, visit after visit.

    `path` `(k, 3)` are the poses from which the graph starts: they complete what a hinge leaves open.
    """
    parts = [_edge(a, b, found.thing.is_door, path) for found in objects for a, b in _pairs(found)]
    if not parts:
        return Edges(*_empty())
    return Edges.concatenate(parts)


def log_object_weights(
    pairs: Iterable[tuple[Stay, Stay, bool]], paths: Floats, move_probability: float
) -> Floats:
    """log P(D | X) `(n,)` of paths `(n, k, 3)`: how well each brings the two estimates of an object to the same place.

    This is the factor P(I|D) P(L|D) of the paper's eq. 6, the object's pose integrated out; it may have been moved after all.
    The pairs say whether the object is a door, of which only the hinge counts.
    """
    out = np.zeros(len(paths))
    for a, b, is_door in pairs:
        here = se2.compose(paths[:, a.anchor], a.pose)
        error = se2.between(here, se2.compose(paths[:, b.anchor], b.pose))
        used = 2 if is_door else 3
        spread = turned(a.covariance, -float(a.pose[2])) + turned(b.covariance, -float(b.pose[2]))
        precision = np.linalg.inv(spread + 2.0 * np.diag(LEAST_DEVIATIONS**2))[:used, :used]
        square = np.einsum("ni,ij,nj->n", error[:, :used], precision, error[:, :used])
        out += np.log((1.0 - move_probability) * np.exp(-0.5 * square) + move_probability)
    return out


def _pairs(found: TrackedObject) -> Iterable[tuple[Stay, Stay]]:
    """Estimates, one after the other, of one place: of all a door's, since its hinge stays."""
    bounds = [stay.last_ns for stay in found.stays]
    for a, b in zip(found.seen[:-1], found.seen[1:], strict=True):
        same = sum(a.last_ns > end for end in bounds) == sum(b.last_ns > end for end in bounds)
        if a.anchor != b.anchor and (found.thing.is_door or same):
            yield a, b


def _edge(a: Stay, b: Stay, is_door: bool, path: Floats) -> Edges:
    """The error r = T_a_b p_b - p_a of the pivot seen from both, linear about the poses of the path."""
    T_a_b = se2.between(path[a.anchor], path[b.anchor])
    cos, sin = np.cos(T_a_b[2]), np.sin(T_a_b[2])
    rotation = np.array([[cos, -sin], [sin, cos]])
    arm = rotation @ b.pose[:2]
    error = arm + T_a_b[:2] - a.pose[:2]
    floor = np.diag(LEAST_DEVIATIONS**2)
    covariance = a.covariance + turned(b.covariance, float(T_a_b[2])) + 2.0 * floor
    jacobian = np.eye(3)
    jacobian[:2, 2] = QUARTER @ arm
    measured = T_a_b.copy()
    if is_door:
        information = jacobian[:2].T @ np.linalg.inv(covariance[:2, :2]) @ jacobian[:2]
        measured[:2] -= error
    else:
        information = jacobian.T @ np.linalg.inv(covariance) @ jacobian
        measured = se2.compose(a.pose, se2.inverse(b.pose))
    return Edges(
        np.array([a.anchor]), np.array([b.anchor]), measured[None], information[None], np.ones(1, np.bool_)
    )


def _empty() -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, Floats, NDArray[np.bool_]]:
    none = np.zeros(0, np.int64)
    return none, none, np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, np.bool_)
