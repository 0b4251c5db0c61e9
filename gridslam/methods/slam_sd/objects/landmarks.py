"""Objects found more than once constrain the path: weights of the particles, and edges of the pose graph.

A box that has not moved constrains both poses of the robot rigidly. A door may have turned, but its hinge has not moved: it
constrains the positions only. A moved object gives no constraint.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory

Floats = NDArray[np.float64]

# Smallest standard deviations of an estimate (m, m, rad) within the scans of its visit
MIN_STD = np.array([0.01, 0.01, 0.01])
QUARTER_ROTATION = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Reobservation:
    """Two estimates of one object at the same place; of a door only the hinge is at the same place."""

    before: ObjectEpisode
    after: ObjectEpisode
    is_door: bool


def landmark_edges(objects: Iterable[ObjectHistory], path: Floats) -> Edges:
    """Edges between the key scans from which an object was found at the same place, visit after visit.

    `path` `(k, 3)` are the initial poses of the graph: they complete what a hinge leaves open.
    """
    parts = [_edge(pair, path) for history in objects for pair in _reobservations(history)]
    return Edges.concatenate(parts) if parts else Edges.none()


def log_object_weights(pairs: Iterable[Reobservation], paths: Floats, move_probability: float) -> Floats:
    """log P(D | X) `(n,)` of paths `(n, k, 3)`: how well each brings the two estimates of an object to the same place.

    This is the factor P(I|D) P(L|D) of the paper's eq. 6 with the object's pose integrated out; the object may still have
    been moved.
    """
    out = np.zeros(len(paths))
    for pair in pairs:
        a, b = pair.before, pair.after
        at_a = se2.compose(paths[:, a.anchor], a.pose)
        error = se2.between(at_a, se2.compose(paths[:, b.anchor], b.pose))
        used = 2 if pair.is_door else 3
        covariance = se2.rotate_covariance(a.covariance, -float(a.pose[2]))
        covariance = covariance + se2.rotate_covariance(b.covariance, -float(b.pose[2]))
        precision = np.linalg.inv(covariance + 2.0 * np.diag(MIN_STD**2))[:used, :used]
        squared = np.einsum("ni,ij,nj->n", error[:, :used], precision, error[:, :used])
        out += np.log((1.0 - move_probability) * np.exp(-0.5 * squared) + move_probability)
    return out


def _reobservations(history: ObjectHistory) -> Iterable[Reobservation]:
    """Consecutive estimates of one episode; of a door all consecutive estimates, since its hinge does not move."""
    ends = [episode.last_ns for episode in history.episodes]
    for a, b in zip(history.estimates[:-1], history.estimates[1:], strict=True):
        same = sum(a.last_ns > end for end in ends) == sum(b.last_ns > end for end in ends)
        if a.anchor != b.anchor and (history.model.is_door or same):
            yield Reobservation(a, b, history.model.is_door)


def _edge(pair: Reobservation, path: Floats) -> Edges:
    """The error r = T_a_b p_b - p_a of the pivot seen from both key scans, linearised about the poses of the path."""
    a, b = pair.before, pair.after
    T_a_b = se2.between(path[a.anchor], path[b.anchor])
    cos, sin = np.cos(T_a_b[2]), np.sin(T_a_b[2])
    rotation = np.array([[cos, -sin], [sin, cos]])
    lever = rotation @ b.pose[:2]
    error = lever + T_a_b[:2] - a.pose[:2]
    floor = np.diag(MIN_STD**2)
    covariance = a.covariance + se2.rotate_covariance(b.covariance, float(T_a_b[2])) + 2.0 * floor
    jacobian = np.eye(3)
    jacobian[:2, 2] = QUARTER_ROTATION @ lever
    measured = T_a_b.copy()
    if pair.is_door:
        information = jacobian[:2].T @ np.linalg.inv(covariance[:2, :2]) @ jacobian[:2]
        measured[:2] -= error
    else:
        information = jacobian.T @ np.linalg.inv(covariance) @ jacobian
        measured = se2.compose(a.pose, se2.inverse(b.pose))
    return Edges(
        np.array([a.anchor]), np.array([b.anchor]), measured[None], information[None], np.ones(1, np.bool_)
    )
