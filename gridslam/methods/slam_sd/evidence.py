"""What the sensors said during one visit to an object, in the front end's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import object_weights
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.things import Thing
from gridslam.methods.slam_sd.walls import Walls, find_walls
from gridslam.sensors.rfid import Rounds, range_profile

Floats = NDArray[np.float64]
T = TypeVar("T")

ABOUT_M = 4.5  # walls are looked for so far about the place
LEAST_WALL_M = 1.5
WALL_PER_LENGTH = 1.3  # a wall is longer than the object that might be taken for one


@dataclass(frozen=True, slots=True)
class SeenScan:
    """A key scan, and the front end's pose at it (3,)."""

    key: int
    stamp_ns: int
    pose: Floats
    scan: PreparedScan

    @property
    def viewpoint(self) -> Floats:
        """The lidar's pose (3,); the heading is the robot's."""
        return se2.compose(self.pose, np.array([*self.scan.viewpoint, 0.0]))


@dataclass(frozen=True, slots=True)
class SeenRound:
    """One inventory round: the antenna's pose (3,), and the tags that it read."""

    stamp_ns: int
    antenna: Floats
    tag_ids: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Evidence:
    """Rounds with which of them read each tag `(t, r)`, and the beams of the visit's scans.

    `beams` `(m, 4)` are origins and unit directions with their `ranges` `(m,)`; `other_m` `(m,)` is each end point's
    distance from a wall or another object, infinite where there is none; `others` are the outlines `(k, 2)` of those objects.
    """

    rounds: Rounds
    reads: NDArray[np.bool_]
    beams: Floats
    ranges: Floats
    other_m: Floats
    walls: Walls
    others: tuple[Floats, ...] = ()

    def near(self, centre: Floats, radius_m: float) -> Evidence:
        """With those beams only that pass a place (2,) within a radius."""
        way = centre - self.beams[:, :2]
        aside = np.abs(self.beams[:, 2] * way[:, 1] - self.beams[:, 3] * way[:, 0])
        ahead = (self.beams[:, 2:] * way).sum(axis=1)
        kept = (aside < radius_m) & (ahead > -radius_m)
        return self._with(kept)

    def thinned(self, step: int) -> Evidence:
        """With every so many of the beams."""
        return self._with(np.arange(len(self.ranges)) % step == 0)

    def _with(self, kept: NDArray[np.bool_]) -> Evidence:
        return replace(self, beams=self.beams[kept], ranges=self.ranges[kept], other_m=self.other_m[kept])

    def explained_by(self, outlines: Sequence[Floats]) -> Evidence:
        """With end points on these outlines `(k, 2)`, those of other objects, explained by them: a beam has one cause."""
        other = self.other_m
        for corners in outlines:
            other = np.minimum(
                other, np.abs(object_weights.distances_behind(corners, self.beams, self.ranges))
            )
        return replace(self, other_m=other, others=(*self.others, *outlines))


def gather(
    thing: Thing,
    scans: Sequence[SeenScan],
    rounds: Sequence[SeenRound],
    centre: Floats,
    config: ObjectsConfig,
) -> Evidence:
    """The evidence of a visit; `centre` (2,) is where about the object must be."""
    scans = _spread(scans, config.most_scans)
    rounds = _spread(rounds, config.most_rounds)
    points = [se2.transform_points(seen.pose, seen.scan.returns) for seen in scans]
    views = np.array([seen.viewpoint for seen in scans]).reshape(-1, 3)
    stamps = np.array([seen.stamp_ns for seen in scans], np.int64)
    nearest = [int(np.argmin(np.abs(stamps - r.stamp_ns))) for r in rounds]
    placed = Rounds(
        np.array([r.antenna for r in rounds]).reshape(-1, 3),
        np.array(nearest, np.int64),
        views,
        np.array([range_profile(p, v) for p, v in zip(points, views, strict=True)]),
    )
    reads = np.array([[tag in r.tag_ids for r in rounds] for tag in thing.tag_ids]).reshape(-1, len(rounds))
    ends = np.concatenate(points)
    about = ends[np.hypot(*(ends - centre).T) < ABOUT_M]
    walls = find_walls(about, max(LEAST_WALL_M, WALL_PER_LENGTH * thing.length_m))
    origins = np.repeat(views[:, :2], [len(p) for p in points], axis=0)
    way = ends - origins
    ranges = np.hypot(way[:, 0], way[:, 1])
    seen = ranges > 1e-6
    beams = np.column_stack([origins, way / np.maximum(ranges, 1e-6)[:, None]])[seen]
    return Evidence(placed, reads, beams, ranges[seen], walls.distances(ends[seen]), walls)


def _spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many of them, evenly spread."""
    n = len(items)
    return list(items) if n <= most else [items[(i * n) // most] for i in range(most)]
