"""How well the objects in a map were found: where, what, moved or not, doors open or closed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2


@dataclass(frozen=True, slots=True)
class MapObject:
    """An object in the map frame; what is not known of it is None."""

    pose: tuple[float, float, float]
    category: str | None = None  # box, door, ...
    moved: bool | None = None
    state: str | None = None  # of a door: open, closed


@dataclass(frozen=True, slots=True)
class ObjectErrors:
    """Errors of the true objects that were found (matched by id), `(n,)` each, and counts.

    `correct` objects are near enough, and all that the truth says of category, movement and state agrees.
    `doors_state_correct` counts found doors of known state whose state is right, out of `doors`.
    """

    count: int
    found: int
    correct: int
    extra: int
    position_m: NDArray[np.float64]
    heading_deg: NDArray[np.float64]
    doors: int
    doors_state_correct: int


def object_errors(
    found: Mapping[str, MapObject],
    truth: Mapping[str, MapObject],
    T_truth_map: NDArray[np.float64],
    max_position_m: float = 0.5,
) -> ObjectErrors:
    """Compare objects by id, the found ones moved by `T_truth_map` (x, y, yaw) into the truth's frame."""
    ids = sorted(truth.keys() & found.keys())
    here = np.array([found[i].pose for i in ids]).reshape(-1, 3)
    there = np.array([truth[i].pose for i in ids]).reshape(-1, 3)
    difference = se2.between(there, se2.compose(T_truth_map, here))
    position = np.hypot(difference[:, 0], difference[:, 1])
    right = [
        bool(distance <= max_position_m) and _agrees(found[i], truth[i])
        for i, distance in zip(ids, position, strict=True)
    ]
    doors = {i for i, obj in truth.items() if obj.state is not None}
    return ObjectErrors(
        count=len(truth),
        found=len(ids),
        correct=sum(right),
        extra=len(found.keys() - truth.keys()),
        position_m=position,
        heading_deg=np.rad2deg(np.abs(difference[:, 2])),
        doors=len(doors),
        doors_state_correct=sum(i in found and found[i].state == truth[i].state for i in doors),
    )


def _agrees(found: MapObject, truth: MapObject) -> bool:
    return (
        truth.category in (None, found.category)
        and truth.moved in (None, found.moved)
        and truth.state in (None, found.state)
    )
