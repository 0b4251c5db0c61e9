"""objects.csv and objects_history.csv."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import wrap_angle
from gridslam.core.stamps import format_stamp
from gridslam.methods.base import Table
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory

Floats = NDArray[np.float64]

DOOR_OPEN_RAD = 0.17  # a leaf within 10 degrees of its wall is closed
POSE = ("x", "y", "yaw")
COVARIANCE = ("var_x", "var_y", "var_yaw", "cov_xy", "cov_x_yaw", "cov_y_yaw")
COLUMNS = (
    "id",
    "class",
    *POSE,
    "moved",
    "state",
    "present",
    "door_angle",
    "first_seen",
    "last_seen",
    "reads",
)
HISTORY_COLUMNS = ("stamp", "id", "class", *POSE, "moved", "state", "door_angle", "reads")


def objects_table(objects: Iterable[ObjectHistory], path: Floats) -> Table:
    """One row per object that was found, with its last pose in the map frame; stamps in seconds, angles in rad.

    A door's `door_angle` is the angle between leaf and wall, its `state` is open or closed. `present` is false if the object
    was found to be gone. The covariance is over x, y, yaw. `path` `(k, 3)` are the poses of the key scans.
    """
    rows = []
    for history in objects:
        if not history.episodes:
            continue
        episode = history.episodes[-1]
        covariance = episode.covariance_in_map(path)
        rows.append(
            [
                *_identity(history, episode, path),
                _text(history.has_moved),
                state_of(episode),
                _text(history.present is not None),
                _angle(episode),
                format_stamp(history.episodes[0].first_ns),
                format_stamp(episode.last_ns),
                sum(other.reads for other in history.episodes),
                *(f"{covariance[i, i]:.9f}" for i in range(3)),
                *(f"{covariance[i, j]:.9f}" for i, j in ((0, 1), (0, 2), (1, 2))),
            ]
        )
    return Table((*COLUMNS, *COVARIANCE), rows)


def history_table(objects: Iterable[ObjectHistory], path: Floats) -> Table:
    """One row per object and visit, ordered by the stamp of the visit's last read; `moved`: since the previous visit."""
    rows = [
        (estimate.last_ns, history.model.id, row)
        for history in objects
        for estimate, row in _history_rows(history, path)
    ]
    return Table(HISTORY_COLUMNS, [row for _, _, row in sorted(rows, key=lambda item: item[:2])])


def state_of(episode: ObjectEpisode) -> str:
    """`open` or `closed` for a door, empty for any other object."""
    angle = episode.door_angle
    if angle is None:
        return ""
    return "open" if abs(angle) >= DOOR_OPEN_RAD else "closed"


def _history_rows(history: ObjectHistory, path: Floats) -> Iterator[tuple[ObjectEpisode, list[object]]]:
    moved_at = {episode.first_ns for episode in history.episodes[1:]}
    for estimate in history.estimates:
        row = [
            format_stamp(estimate.last_ns),
            *_identity(history, estimate, path),
            _text(estimate.first_ns in moved_at),
            state_of(estimate),
            _angle(estimate),
            estimate.reads,
        ]
        yield estimate, row


def _identity(history: ObjectHistory, episode: ObjectEpisode, path: Floats) -> list[object]:
    """Id, class and pose of the object's own frame."""
    pose = history.model.own_pose(episode.pose_in_map(path))
    return [
        history.model.id,
        history.model.category,
        *(f"{v:.6f}" for v in (*pose[:2], wrap_angle(pose[2]))),
    ]


def _angle(episode: ObjectEpisode) -> str:
    return "" if episode.door_angle is None else f"{episode.door_angle:.6f}"


def _text(value: bool) -> str:
    return str(value).lower()
