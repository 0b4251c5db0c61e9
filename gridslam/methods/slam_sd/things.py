"""Tagged objects in the form that the filters need: doors about their hinges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.tag_database import TagDatabase, TaggedObject

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Thing:
    """An object about its pivot: a door's hinge, else the origin of its own frame.

    `outline` `(k, 2)` and the tags' poses `(t, 3)` are in the pivot's frame; `pivot` (2,) is the pivot in the object's own frame.
    `closed_pose` (3,) is the closed leaf's pivot in the map frame, where that is known.
    """

    id: str
    category: str
    is_door: bool
    outline: Floats
    tag_ids: tuple[str, ...]
    tags: Floats
    pivot: Floats
    closed_pose: Floats | None

    @property
    def centre(self) -> Floats:
        """The middle of the outline (2,)."""
        return np.asarray(0.5 * (self.outline.min(axis=0) + self.outline.max(axis=0)))

    @property
    def radius_m(self) -> float:
        """Of the circle about `centre` that holds the outline."""
        return float(np.hypot(*(self.outline - self.centre).T).max())

    @property
    def length_m(self) -> float:
        """The longest edge of the outline."""
        edges = np.roll(self.outline, -1, axis=0) - self.outline
        return float(np.hypot(*edges.T).max())

    @property
    def inner_points(self) -> Floats:
        """Points well inside the outline `(m, 2)`: its corners and the middles of its edges, drawn in by a tenth."""
        middles = 0.5 * (self.outline + np.roll(self.outline, -1, axis=0))
        return np.asarray(self.centre + 0.9 * (np.concatenate([self.outline, middles]) - self.centre))

    def own_pose(self, pivot_pose: Floats) -> Floats:
        """The object's own frame `(..., 3)` for poses of the pivot `(..., 3)`."""
        return se2.compose(pivot_pose, np.array([-self.pivot[0], -self.pivot[1], 0.0]))

    def placed(self, pivot_pose: Floats) -> Floats:
        """The corners of the outline `(k, 2)` at a pose of the pivot (3,)."""
        return se2.transform_points(pivot_pose, self.outline)


def things_of(database: TagDatabase) -> list[Thing]:
    """All objects of a database."""
    return [_thing(entry) for entry in database.objects]


def _thing(entry: TaggedObject) -> Thing:
    pivot = np.array(entry.hinge if entry.hinge is not None else (0.0, 0.0))
    tags = [[*(np.array(t.position) - pivot), _radians(t.facing_deg)] for t in entry.tags]
    closed = None
    if entry.closed_pose is not None:
        own = np.array([*entry.closed_pose[:2], _radians(entry.closed_pose[2])])
        closed = se2.compose(own, np.array([*pivot, 0.0]))
    return Thing(
        entry.id,
        entry.category,
        entry.is_door,
        np.array(entry.outline) - pivot,
        tuple(tag.id for tag in entry.tags),
        np.array(tags).reshape(-1, 3),
        pivot,
        closed,
    )


def _radians(degrees: float) -> float:
    return float(se2.wrap_angle(math.radians(degrees)))
