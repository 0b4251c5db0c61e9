"""Reads and scans of one visit to an object, in the front end's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.kernels import object_weights
from gridslam.kernels.object_weights import ObservedBeams
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.walls import Walls, find_walls
from gridslam.sensors.rfid import RoundGeometry, range_profile

Floats = NDArray[np.float64]
T = TypeVar("T")

MAX_SCANS = 12  # key scans of a visit that are used: more views of one place add little
MAX_ROUNDS = 100  # inventory rounds of a visit that are used
WALL_RADIUS_M = 4.5  # walls are searched for this close to the object
MIN_WALL_M = 1.5
WALL_PER_LENGTH = 1.3  # a wall is longer than the object, which might be taken for one
MIN_RANGE_M = 1e-6


@dataclass(frozen=True, slots=True)
class KeyScanObservation:
    """A key scan with its index and the front end's pose at it (3,)."""

    key: int
    stamp_ns: int
    pose: Floats
    scan: PreparedScan

    @property
    def viewpoint(self) -> Floats:
        """The lidar's pose (3,) with the robot's heading."""
        return se2.compose(self.pose, np.array([*self.scan.viewpoint, 0.0]))


@dataclass(frozen=True, slots=True)
class InventoryRound:
    """One inventory round: the antenna's pose (3,) and the tags that it read."""

    stamp_ns: int
    antenna: Floats
    tag_ids: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class VisitEvidence:
    """The rounds of a visit, which of them read each tag `(t, r)`, and the beams of its scans.

    `footprints` `(k, 2)` are those of other objects that explain some of the beams.
    """

    rounds: RoundGeometry
    reads: NDArray[np.bool_]
    beams: ObservedBeams
    walls: Walls
    footprints: tuple[Floats, ...] = ()

    def near(self, centre: Floats, radius_m: float) -> VisitEvidence:
        """The evidence with only the beams that pass a place (2,) within a radius."""
        rays = self.beams.rays
        offset = centre - rays[:, :2]
        across = np.abs(rays[:, 2] * offset[:, 1] - rays[:, 3] * offset[:, 0])
        along = (rays[:, 2:] * offset).sum(axis=1)
        return self._with_beams((across < radius_m) & (along > -radius_m))

    def thinned(self, step: int) -> VisitEvidence:
        """The evidence with every `step`-th beam."""
        return self._with_beams(np.arange(len(self.beams.ranges)) % step == 0)

    def explained_by(self, footprints: Sequence[Floats]) -> VisitEvidence:
        """The evidence in which endpoints on these footprints `(k, 2)` are explained by other objects."""
        background = self.beams.background_m
        for corners in footprints:
            behind = object_weights.distances_behind(corners, self.beams.rays, self.beams.ranges)
            background = np.minimum(background, np.abs(behind))
        beams = self.beams._replace(background_m=background)
        return replace(self, beams=beams, footprints=(*self.footprints, *footprints))

    def _with_beams(self, kept: NDArray[np.bool_]) -> VisitEvidence:
        return replace(self, beams=ObservedBeams(*(part[kept] for part in self.beams)))


def gather_evidence(
    model: ObjectModel,
    scans: Sequence[KeyScanObservation],
    rounds: Sequence[InventoryRound],
    centre: Floats,
) -> VisitEvidence:
    """The evidence of a visit; `centre` (2,) is roughly where the object is. There must be at least one return."""
    scans = [scans[k] for k in evenly_spaced(len(scans), MAX_SCANS)]
    rounds = [rounds[k] for k in evenly_spaced(len(rounds), MAX_ROUNDS)]
    points = [se2.transform_points(scan.pose, scan.scan.returns) for scan in scans]
    viewpoints = np.array([scan.viewpoint for scan in scans]).reshape(-1, 3)
    stamps = np.array([scan.stamp_ns for scan in scans], np.int64)
    nearest = [int(np.argmin(np.abs(stamps - r.stamp_ns))) for r in rounds]
    geometry = RoundGeometry(
        np.array([r.antenna for r in rounds]).reshape(-1, 3),
        np.array(nearest, np.int64),
        viewpoints,
        np.array([range_profile(p, v) for p, v in zip(points, viewpoints, strict=True)]),
    )
    reads = np.array([[tag in r.tag_ids for r in rounds] for tag in model.tag_ids]).reshape(-1, len(rounds))
    endpoints = np.concatenate(points)
    close = endpoints[np.hypot(*(endpoints - centre).T) < WALL_RADIUS_M]
    walls = find_walls(close, max(MIN_WALL_M, WALL_PER_LENGTH * model.length_m))
    origins = np.repeat(viewpoints[:, :2], [len(p) for p in points], axis=0)
    return VisitEvidence(geometry, reads, _beams(origins, endpoints, walls), walls)


def _beams(origins: Floats, endpoints: Floats, walls: Walls) -> ObservedBeams:
    """Beams from origins `(m, 2)` to endpoints `(m, 2)` that the walls explain."""
    offset = endpoints - origins
    ranges = np.hypot(offset[:, 0], offset[:, 1])
    used = ranges > MIN_RANGE_M
    rays = np.column_stack([origins, offset / np.maximum(ranges, MIN_RANGE_M)[:, None]])[used]
    return ObservedBeams(rays, ranges[used], walls.distances(endpoints[used]))
