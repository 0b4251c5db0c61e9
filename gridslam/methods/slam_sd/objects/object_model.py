"""Tagged objects in the form that the filters need: doors about their hinges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.maps.tag_database import TagDatabase, TaggedObject

Floats = NDArray[np.float64]

INNER_SCALE = 0.9  # scale of the footprint for points that lie clearly inside it


@dataclass(frozen=True, slots=True)
class ObjectModel:
    """An object about its pivot: a door's hinge, else the origin of its own frame.

    `footprint` `(k, 2)` and the tags' poses `(t, 3)` are in the pivot's frame; `pivot` (2,) is in the object's own frame.
    `closed_pose` (3,) is the pivot's pose of the closed leaf in the map frame, if known.
    """

    id: str
    category: str
    is_door: bool
    footprint: Floats
    tag_ids: tuple[str, ...]
    tags: Floats
    pivot: Floats
    closed_pose: Floats | None

    @property
    def centre(self) -> Floats:
        """Centre of the footprint (2,)."""
        return np.asarray(0.5 * (self.footprint.min(axis=0) + self.footprint.max(axis=0)))

    @property
    def radius_m(self) -> float:
        """Radius of the circle about `centre` that contains the footprint."""
        return float(np.hypot(*(self.footprint - self.centre).T).max())

    @property
    def length_m(self) -> float:
        """Longest edge of the footprint."""
        edges = np.roll(self.footprint, -1, axis=0) - self.footprint
        return float(np.hypot(*edges.T).max())

    @property
    def inner_points(self) -> Floats:
        """Points clearly inside the footprint `(m, 2)`: corners and midpoints of the edges, moved inwards by a tenth."""
        midpoints = 0.5 * (self.footprint + np.roll(self.footprint, -1, axis=0))
        points = np.concatenate([self.footprint, midpoints])
        return np.asarray(self.centre + INNER_SCALE * (points - self.centre))

    def own_pose(self, pivot_pose: Floats) -> Floats:
        """Poses `(..., 3)` of the object's own frame for poses of the pivot `(..., 3)`."""
        return se2.compose(pivot_pose, np.array([-self.pivot[0], -self.pivot[1], 0.0]))

    def corners_at(self, pivot_pose: Floats) -> Floats:
        """Corners of the footprint `(k, 2)` for a pose of the pivot (3,)."""
        return se2.transform_points(pivot_pose, self.footprint)

    def centre_at(self, pivot_pose: Floats) -> Floats:
        """Centre of the footprint (2,) for a pose of the pivot (3,)."""
        return np.asarray(se2.transform_points(pivot_pose, self.centre[None])[0])


def object_models(database: TagDatabase) -> list[ObjectModel]:
    """Models of all objects of a database."""
    return [_model_of(entry) for entry in database.objects]


def _model_of(entry: TaggedObject) -> ObjectModel:
    pivot = np.array(entry.hinge if entry.hinge is not None else (0.0, 0.0))
    tags = [[*(np.array(t.position) - pivot), _radians(t.facing_deg)] for t in entry.tags]
    closed = None
    if entry.closed_pose is not None:
        own = np.array([*entry.closed_pose[:2], _radians(entry.closed_pose[2])])
        closed = se2.compose(own, np.array([*pivot, 0.0]))
    return ObjectModel(
        id=entry.id,
        category=entry.category,
        is_door=entry.is_door,
        footprint=np.array(entry.footprint) - pivot,
        tag_ids=tuple(tag.id for tag in entry.tags),
        tags=np.array(tags).reshape(-1, 3),
        pivot=pivot,
        closed_pose=closed,
    )


def _radians(degrees: float) -> float:
    return float(se2.wrap_angle(math.radians(degrees)))
