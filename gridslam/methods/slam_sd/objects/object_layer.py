"""The objects of a run as slam-sd uses them, and the layer of a run without any."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import TagInventory
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.slam_sd.objects.object_history import ObjectHistory
from gridslam.methods.slam_sd.objects.object_result import ObjectResult
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class ObjectLayer(Protocol):
    """The objects of a run, as slam-sd uses them.

    A `path` `(k, 3)` holds the poses of all key scans in the map frame.
    """

    @property
    def counters(self) -> Counter[str]:
        """Rounds used and skipped, reads that were not believed."""

    @property
    def found(self) -> list[ObjectHistory]:
        """The objects that have been found."""

    @property
    def may_find(self) -> bool:
        """Whether objects can be found: then the particles are weighted by those that are found again."""

    def add_round(self, event: TagInventory) -> None:
        """Add one inventory round."""

    def place_rounds(
        self,
        stamps_ns: Sequence[int],
        track: Sequence[Floats],
        sensor_extrinsics: Mapping[str, LidarExtrinsics],
    ) -> None:
        """Compute the antennas' poses of the waiting rounds up to the last scan.

        `stamps_ns` and `track` `(3,)` each are the last scans' stamps and poses in the front end's frame.
        """

    def add_key_scan(self, scan: PreparedScan, pose: Floats, path: Floats) -> None:
        """Add one key scan at a pose (3,) of the front end's frame; `path` `(k, 3)` is the best particle's so far."""

    def log_weights(self, paths: Floats) -> Floats | None:
        """Log weights `(n,)` of the particles' paths `(n, k, 3)` by the objects found again since the last call, if any."""

    def finish(self, path: Floats) -> None:
        """Process what waits at the end of the log; `path` `(k, 3)` are the poses of the key scans."""

    def update_history(self, path: Floats) -> None:
        """Repeat the decision which objects were moved, with better poses `(k, 3)` of the key scans."""

    def landmarks(self, path: Floats) -> Edges | None:
        """Pose graph edges between key scans from which an object was found at the same place; `path` `(k, 3)`."""

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """Key scan `key` without the endpoints on objects."""

    def all_without_objects(self, scans: Sequence[PreparedScan], path: Floats) -> Sequence[PreparedScan]:
        """All key scans without the endpoints on objects; `path` `(k, 3)`."""

    def all_without_moved_objects(
        self, scans: Sequence[PreparedScan], path: Floats
    ) -> Sequence[PreparedScan]:
        """All key scans without the endpoints on objects that have been moved; `path` `(k, 3)`."""

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """Masks `(r,)` of the returns of each key scan that lie on an object; None if no object was found."""

    def continue_histories(self, earlier: ObjectRecords, first_key: int, path: Floats) -> None:
        """Let the histories follow those of earlier drives; `path` `(k, 3)` are the poses of the key scans of all drives.

        The drive's own key scans are numbered from `first_key` from here on.
        """

    def records(self, earlier: ObjectRecords) -> ObjectRecords:
        """The estimates of all objects for the session; those of earlier drives if this one has no tags."""

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """Maps, tables and the picture of the objects for a `path` `(k, 3)`; None if no object was found."""


class NoObjects:
    """The layer of a run without a tag database: it counts the rounds that cannot be used."""

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self.found: list[ObjectHistory] = []
        self.may_find = False

    def add_round(self, event: TagInventory) -> None:
        """Count the round."""
        self.counters["skipped.tags.no_database"] += 1

    def place_rounds(
        self,
        stamps_ns: Sequence[int],
        track: Sequence[Floats],
        sensor_extrinsics: Mapping[str, LidarExtrinsics],
    ) -> None:
        """Do nothing: no round waits (see `ObjectLayer`)."""

    def add_key_scan(self, scan: PreparedScan, pose: Floats, path: Floats) -> None:
        """Do nothing: the scan shows no tagged object (see `ObjectLayer`)."""

    def log_weights(self, paths: Floats) -> Floats | None:
        """Return None: no object is found again (see `ObjectLayer`)."""
        return None

    def finish(self, path: Floats) -> None:
        """Do nothing: no round waits (see `ObjectLayer`)."""

    def update_history(self, path: Floats) -> None:
        """Do nothing: there are no objects (see `ObjectLayer`)."""

    def landmarks(self, path: Floats) -> Edges | None:
        """Return None: there are no objects (see `ObjectLayer`)."""
        return None

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """The scan itself (see `ObjectLayer`)."""
        return scan

    def all_without_objects(self, scans: Sequence[PreparedScan], path: Floats) -> Sequence[PreparedScan]:
        """The scans themselves (see `ObjectLayer`)."""
        return scans

    def all_without_moved_objects(
        self, scans: Sequence[PreparedScan], path: Floats
    ) -> Sequence[PreparedScan]:
        """The scans themselves (see `ObjectLayer`)."""
        return scans

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """Return None: there are no objects, and no masks (see `ObjectLayer`)."""
        return None

    def continue_histories(self, earlier: ObjectRecords, first_key: int, path: Floats) -> None:
        """Do nothing: there are no histories (see `ObjectLayer`)."""

    def records(self, earlier: ObjectRecords) -> ObjectRecords:
        """The records of earlier drives (see `ObjectLayer`)."""
        return earlier

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """Return None: there are no objects, and no result (see `ObjectLayer`)."""
        return None
