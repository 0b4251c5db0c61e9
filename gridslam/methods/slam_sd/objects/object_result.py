"""Contribution of the tagged objects to a run's result: maps, tables and a picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.base import Picture, PlacedObject, RunResult, Table
from gridslam.methods.slam_sd.objects.composition import compose_map
from gridslam.methods.slam_sd.objects.object_history import ObjectHistory
from gridslam.methods.slam_sd.objects.object_tables import history_table, objects_table, state_of

Floats = NDArray[np.float64]
Colour = tuple[int, int, int]

BOX: Colour = (30, 110, 200)
OPEN_DOOR: Colour = (235, 130, 20)
CLOSED_DOOR: Colour = (120, 70, 20)
MOVED: Colour = (205, 45, 45)
COLOUR_OF_STATE = {"": BOX, "open": OPEN_DOOR, "closed": CLOSED_DOOR}
NOTE = "Static map; boxes blue, doors closed brown and open orange; what has moved is red."


@dataclass(frozen=True, slots=True)
class ObjectResult:
    """Maps, tables, pictures and measures that the objects add to a run's result."""

    maps: Mapping[str, OccupancyGrid]
    tables: Mapping[str, Table]
    objects: Sequence[PlacedObject]
    pictures: Mapping[str, Picture]
    measures: Mapping[str, object]

    def added_to(self, result: RunResult) -> RunResult:
        """A run's result with its objects; the map becomes the composed one: what a robot would meet now."""
        return replace(
            result,
            occupancy=self.maps["composed"],
            maps={**result.maps, **self.maps},
            tables={**result.tables, **self.tables},
            objects=self.objects,
            pictures={**result.pictures, **self.pictures},
            measures={**result.measures, "objects": self.measures},
        )


def result_of(
    objects: Sequence[ObjectHistory], static: OccupancyGrid, path: Floats, trajectory: Trajectory
) -> ObjectResult:
    """The result of the objects that were found, for the final poses `(k, 3)` of the key scans."""
    drawn = list(_drawn_footprints(objects, path))
    composed = compose_map(static, [corners for corners, _, _ in drawn])
    picture = np.asarray(render_map(static, trajectory, footprints=drawn))
    return ObjectResult(
        maps={"static": static, "composed": composed},
        tables={
            "objects": objects_table(objects, path),
            "objects_history": history_table(objects, path),
        },
        objects=list(_placed_objects(objects, path)),
        pictures={"objects": Picture(picture, "Objects", NOTE)},
        measures={
            "found": len(objects),
            "moved": sum(history.has_moved for history in objects),
            "gone": sum(history.present is None for history in objects),
        },
    )


def _placed_objects(objects: Sequence[ObjectHistory], path: Floats) -> Iterator[PlacedObject]:
    """The objects where they were last seen."""
    for history in objects:
        if history.episodes:
            last = history.episodes[-1]
            pose = history.model.own_pose(last.pose_in_map(path))
            yield PlacedObject(history.model.id, pose, state_of(last), history.has_moved)


def _drawn_footprints(objects: Sequence[ObjectHistory], path: Floats) -> Iterator[tuple[Floats, Colour, str]]:
    """Corners `(k, 2)` in the map frame, colour and id of each present object."""
    for history in objects:
        episode = history.present
        if episode is not None:
            colour = MOVED if history.has_moved else COLOUR_OF_STATE[state_of(episode)]
            yield history.model.corners_at(episode.pose_in_map(path)), colour, history.model.id
