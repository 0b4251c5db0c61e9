"""objects.csv and objects_history.csv."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import wrap_angle
from gridslam.core.stamps import format_stamp
from gridslam.methods.base import Table
from gridslam.methods.slam_sd.stays import Stay, TrackedObject

Floats = NDArray[np.float64]

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
HISTORY = ("stamp", "id", "class", *POSE, "moved", "state", "door_angle", "reads")


def objects_table(objects: Iterable[TrackedObject], path: Floats, open_from_rad: float) -> Table:
    """One row per object that was found: where it is now (or was last), in the map frame; stamps in seconds, angles in rad.

    A door's `door_angle` is that between the leaf and the wall; its `state` is open or closed. `present` is false once
    an object was found to be gone. The covariance is over x, y, yaw.
    """
    rows = []
    for found in objects:
        if not found.stays:
            continue
        stay = found.stays[-1]
        covariance = stay.covariance_in_map(path)
        rows.append(
            [
                *_identity(found, stay, path),
                _text(found.has_moved),
                state_of(stay, open_from_rad),
                _text(found.present is not None),
                _angle(stay),
                format_stamp(found.stays[0].first_ns),
                format_stamp(stay.last_ns),
                sum(other.reads for other in found.stays),
                *(f"{covariance[i, i]:.9f}" for i in range(3)),
                *(f"{covariance[i, j]:.9f}" for i, j in ((0, 1), (0, 2), (1, 2))),
            ]
        )
    return Table((*COLUMNS, *COVARIANCE), rows)


def history_table(objects: Iterable[TrackedObject], path: Floats, open_from_rad: float) -> Table:
    """One row per object and visit, ordered by the stamp of the visit's last read; `moved`: since the visit before."""
    rows = [
        (stay.last_ns, found.thing.id, row)
        for found in objects
        for stay, row in _history_rows(found, path, open_from_rad)
    ]
    return Table(HISTORY, [row for _, _, row in sorted(rows, key=lambda item: item[:2])])


def state_of(stay: Stay, open_from_rad: float) -> str:
    """Of a door: open or closed; empty for anything else."""
    angle = stay.door_angle
    if angle is None:
        return ""
    return "open" if abs(angle) >= open_from_rad else "closed"


def _history_rows(
    found: TrackedObject, path: Floats, open_from_rad: float
) -> Iterator[tuple[Stay, list[object]]]:
    begun = {stay.first_ns for stay in found.stays[1:]}
    for stay in found.seen:
        row = [
            format_stamp(stay.last_ns),
            *_identity(found, stay, path),
            _text(stay.first_ns in begun),
            state_of(stay, open_from_rad),
            _angle(stay),
            stay.reads,
        ]
        yield stay, row


def _identity(found: TrackedObject, stay: Stay, path: Floats) -> list[object]:
    pose = found.thing.own_pose(stay.placed(path))
    return [found.thing.id, found.thing.category, *(f"{v:.6f}" for v in (*pose[:2], wrap_angle(pose[2])))]


def _angle(stay: Stay) -> str:
    return "" if stay.door_angle is None else f"{stay.door_angle:.6f}"


def _text(value: bool) -> str:
    return str(value).lower()
