"""Errors of mapped objects: pose, class, moved or not, door state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2


@dataclass(frozen=True, slots=True)
class MapObject:
    """An object: pose x, y (m), yaw (rad) in the map frame; unknown properties are None."""

    pose: tuple[float, float, float]
    category: str | None = None  # box, door, ...
    moved: bool | None = None
    state: str | None = None  # open or closed; None for an object without states


@dataclass(frozen=True, slots=True)
class ObjectErrors:
    """Position (m) and heading (deg) errors `(n,)` of the true objects that were found (matched by id), and counts.

    A `correct` object is within the position bound, and its category, movement and state agree with the ground truth where
    that states them. `doors_state_correct` of the `doors` with a true state were found with that state.
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
    """Compare objects by id, after transforming the found ones by `T_truth_map` (x, y, yaw)."""
    ids = sorted(truth.keys() & found.keys())
    estimated = np.array([found[i].pose for i in ids]).reshape(-1, 3)
    true = np.array([truth[i].pose for i in ids]).reshape(-1, 3)
    difference = se2.between(true, se2.compose(T_truth_map, estimated))
    position = np.hypot(difference[:, 0], difference[:, 1])
    is_correct = [
        bool(distance <= max_position_m) and _has_true_state(found[i], truth[i])
        for i, distance in zip(ids, position, strict=True)
    ]
    doors = {i for i, obj in truth.items() if obj.state is not None}
    return ObjectErrors(
        count=len(truth),
        found=len(ids),
        correct=sum(is_correct),
        extra=len(found.keys() - truth.keys()),
        position_m=position,
        heading_deg=np.rad2deg(np.abs(difference[:, 2])),
        doors=len(doors),
        doors_state_correct=sum(i in found and found[i].state == truth[i].state for i in doors),
    )


def _has_true_state(found: MapObject, truth: MapObject) -> bool:
    return (
        truth.category in (None, found.category)
        and truth.moved in (None, found.moved)
        and truth.state in (None, found.state)
    )
