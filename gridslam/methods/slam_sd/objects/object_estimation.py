"""From the posterior of a visit to an estimate in the object's history, and back to the prior of the next visit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.doors import MAX_HINGE_DISTANCE_M, closed_yaw_of
from gridslam.methods.slam_sd.objects.joint_estimation import LocatedObject
from gridslam.methods.slam_sd.objects.object_filter import LIDAR_WEIGHT
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.observations import RunObservations
from gridslam.methods.slam_sd.objects.pose_prior import PriorEstimate
from gridslam.methods.slam_sd.objects.tag_visits import TagVisit

Floats = NDArray[np.float64]

REVISIT_STD = np.array([0.08, 0.08, 0.03])  # x, y (m), yaw (rad): error of the map between two visits
MIN_MOVE_M = 0.15  # smaller changes are not a move
MIN_MOVE_RAD = 0.2


def earlier_estimate(
    history: ObjectHistory, observations: RunObservations, path: Floats, key: int
) -> PriorEstimate | None:
    """The last pose of an object, in the front end's frame at key scan `key`; its covariance includes the error of the map.

    `path` `(k, 3)` are the poses of the key scans in the map. For an object that was not found yet this is the pose of the
    closed leaf, if it is known.
    """
    T_track_map = observations.map_in_track(key, path)
    if history.episodes:
        episode = history.episodes[-1]
        pose = se2.compose(T_track_map, episode.pose_in_map(path))
        yaw = float(T_track_map[2] + path[episode.anchor, 2])
        covariance = se2.rotate_covariance(episode.covariance, yaw)
    elif history.model.closed_pose is not None:
        pose, covariance = se2.compose(T_track_map, history.model.closed_pose), np.zeros((3, 3))
    else:
        return None
    return PriorEstimate(pose, covariance + np.diag(np.square(REVISIT_STD)))


def estimate_of(
    history: ObjectHistory, visit: TagVisit, located: LocatedObject, observations: RunObservations
) -> ObjectEpisode:
    """The estimate of a visit, relative to the key scan in its middle."""
    anchor = observations.key_nearest_to(visit.middle_ns)
    closed = None
    if history.model.is_door:
        before = _earlier_closed_yaw(history, located.visited.earlier)
        closed = closed_yaw_of(located.posterior.pose, located.visited.evidence.walls, before)
    T_track_base = observations.scans[anchor].pose
    return ObjectEpisode(
        anchor=anchor,
        pose=se2.between(T_track_base, located.posterior.pose),
        covariance=se2.rotate_covariance(located.posterior.covariance, -float(T_track_base[2])),
        first_ns=visit.first_ns,
        last_ns=visit.last_ns,
        reads=visit.reads,
        gain=located.posterior.gain,
        closed_yaw=None if closed is None else float(se2.wrap_angle(closed - T_track_base[2])),
    )


def replace_last_estimate(
    history: ObjectHistory, located: LocatedObject, observations: RunObservations
) -> None:
    """Correct the last estimate of an object that a neighbour has displaced."""
    episode, estimate = history.episodes[-1], history.estimates[-1]
    T_track_base = observations.scans[estimate.anchor].pose
    closed = None
    if history.model.is_door:
        is_first = len(history.estimates) == 1
        before = None if is_first else _earlier_closed_yaw(history, located.visited.earlier)
        closed = closed_yaw_of(located.posterior.pose, located.visited.evidence.walls, before)
    history.estimates[-1] = replace(
        estimate,
        pose=se2.between(T_track_base, located.posterior.pose),
        covariance=se2.rotate_covariance(located.posterior.covariance, -float(T_track_base[2])),
        gain=located.posterior.gain,
        closed_yaw=None if closed is None else float(se2.wrap_angle(closed - T_track_base[2])),
    )
    history.episodes[-1] = replace(history.estimates[-1], first_ns=episode.first_ns, reads=episode.reads)


def is_seen_by_lidar(located: LocatedObject, settings: ObjectSettings) -> bool:
    """Whether the scans show the object: a tag may be read of an object above or below the plane of the scan.

    A closed door in its wall gains little: there the scans only must not speak against it.
    """
    gain = LIDAR_WEIGHT * located.posterior.gain
    min_ratio = settings.evidence.min_log_likelihood_ratio
    hinge = located.posterior.pose[None, :2]
    is_door = located.visited.model.is_door
    if is_door and located.visited.evidence.walls.distances(hinge)[0] < MAX_HINGE_DISTANCE_M:
        return gain > -min_ratio
    return gain > min_ratio


def has_moved(model: ObjectModel, before: Floats, after: Floats) -> bool:
    """Whether an object was moved from a pose (3,) to another: a door by its yaw, any other object also by its position."""
    change = se2.between(before, after)
    has_rotated = abs(float(change[2])) > MIN_MOVE_RAD
    is_elsewhere = float(np.hypot(change[0], change[1])) > MIN_MOVE_M
    return has_rotated or (is_elsewhere and not model.is_door)


def _earlier_closed_yaw(history: ObjectHistory, earlier: PriorEstimate | None) -> float | None:
    """Heading of the closed leaf in the front end's frame, if it is known from before the visit."""
    if earlier is None:
        return None
    if history.episodes:
        angle = history.episodes[-1].door_angle
        return None if angle is None else float(earlier.pose[2]) - angle
    return float(earlier.pose[2])
