"""Tagged objects of a run: rounds get the poses of their antennas, scans lose the points on objects, results are collected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import TagInventory
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory, pose_at
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.slam_sd.objects.landmarks import landmark_edges, log_object_weights
from gridslam.methods.slam_sd.objects.object_config import ObjectEvidenceConfig, ObjectsConfig
from gridslam.methods.slam_sd.objects.object_history import ObjectHistory
from gridslam.methods.slam_sd.objects.object_model import object_models
from gridslam.methods.slam_sd.objects.object_records import records_of
from gridslam.methods.slam_sd.objects.object_result import ObjectResult, result_of
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.object_tracker import ObjectTracker
from gridslam.methods.slam_sd.objects.point_masks import footprints_at_key_scan, points_on, without_points_on
from gridslam.methods.slam_sd.objects.visit_evidence import InventoryRound, KeyScanObservation
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MAX_SCAN_GAP_NS = 2_000_000_000  # a round between two scans farther apart has no pose


class TaggedObjects:
    """Tagged objects for slam-sd; without tag reads a run is the same as without this layer."""

    def __init__(
        self,
        database: TagDatabase,
        objects: ObjectsConfig,
        evidence: ObjectEvidenceConfig,
        rng: np.random.Generator,
        stopwatch: Stopwatch,
    ) -> None:
        self._margin_m = evidence.footprint_margin_m
        self._move_probability = evidence.move_probability
        self._stopwatch = stopwatch
        self._tracker = ObjectTracker(object_models(database), ObjectSettings(objects, evidence), rng)
        self._waiting: list[TagInventory] = []
        self._counters: Counter[str] = Counter()
        self._key_scans = 0
        self.may_find = True

    @property
    def counters(self) -> Counter[str]:
        """Rounds used and skipped, reads and visits that were not used."""
        return self._counters + self._tracker.counters

    @property
    def found(self) -> list[ObjectHistory]:
        """The objects that have been found."""
        return [history for history in self._tracker.objects.values() if history.episodes]

    def add_round(self, event: TagInventory) -> None:
        """Add one inventory round; it waits for the next scan."""
        self._waiting.append(event)

    def place_rounds(
        self,
        stamps_ns: Sequence[int],
        track: Sequence[Floats],
        sensor_extrinsics: Mapping[str, LidarExtrinsics],
    ) -> None:
        """Give the waiting rounds up to the last scan their antennas' poses, interpolated between scans (see `ObjectLayer`)."""
        due = [event for event in self._waiting if event.stamp_ns <= stamps_ns[-1]]
        self._waiting = [event for event in self._waiting if event.stamp_ns > stamps_ns[-1]]
        for event in due:
            extrinsics = sensor_extrinsics.get(event.frame_id)
            pose = pose_at(event.stamp_ns, stamps_ns, track, MAX_SCAN_GAP_NS)
            if extrinsics is None:
                self._counters["skipped.tags.no_extrinsics"] += 1
            elif pose is None:
                self._counters["skipped.tags.no_scan"] += 1
            else:
                self._counters["used.tags"] += 1
                antenna = se2.compose(pose, extrinsics.pose)
                self._tracker.add_round(InventoryRound(event.stamp_ns, antenna, event.tag_ids))

    def add_key_scan(self, scan: PreparedScan, pose: Floats, path: Floats) -> None:
        """Add one key scan at a pose (3,) of the front end's frame; `path` `(k, 3)` is the best particle's so far."""
        with self._stopwatch.stage("objects"):
            self._tracker.add_scan(KeyScanObservation(self._key_scans, scan.stamp_ns, pose, scan), path)
            self._key_scans += 1

    def log_weights(self, paths: Floats) -> Floats | None:
        """Log weights `(n,)` of the particles' paths `(n, k, 3)` by the objects found again since the last call, if any."""
        with self._stopwatch.stage("objects"):
            pairs = self._tracker.take_reobservations()
            return log_object_weights(pairs, paths, self._move_probability) if pairs else None

    def finish(self, path: Floats) -> None:
        """Process what waits at the end of the log; `path` `(k, 3)` are the poses of the key scans."""
        with self._stopwatch.stage("objects"):
            self._counters["skipped.tags.no_scan"] += len(self._waiting)
            self._waiting.clear()
            self._tracker.finish(path)

    def update_history(self, path: Floats) -> None:
        """Repeat the decision which objects were moved, with better poses `(k, 3)` of the key scans."""
        self._tracker.update_episodes(path)

    def landmarks(self, path: Floats) -> Edges | None:
        """Edges between key scans from which an object was found at the same place; `path` `(k, 3)`."""
        return landmark_edges(self.found, path) if self.found else None

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """Key scan `key` without the endpoints on tagged objects."""
        return self._without(self.found, key, scan, path)

    def all_without_objects(self, scans: Sequence[PreparedScan], path: Floats) -> Sequence[PreparedScan]:
        """All key scans without the endpoints on tagged objects; `path` `(k, 3)`."""
        return [self._without(self.found, key, scan, path) for key, scan in enumerate(scans)]

    def all_without_moved_objects(
        self, scans: Sequence[PreparedScan], path: Floats
    ) -> Sequence[PreparedScan]:
        """All key scans without the endpoints on objects that have been moved; `path` `(k, 3)`."""
        moved = [found for found in self.found if found.has_moved]
        return [self._without(moved, key, scan, path) for key, scan in enumerate(scans)]

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """Masks `(r,)` of the returns of each key scan that lie on an object; None if no object was found."""
        found = self.found
        if not found:
            return None
        return [
            points_on(scan.returns, footprints_at_key_scan(key, scan.stamp_ns, path, found), self._margin_m)
            for key, scan in enumerate(scans)
        ]

    def continue_histories(self, earlier: ObjectRecords, first_key: int, path: Floats) -> None:
        """Let the histories follow those of earlier drives; `path` `(k, 3)` are the poses of the key scans of all drives."""
        self._tracker.continue_histories(earlier, first_key, path)

    def records(self, earlier: ObjectRecords) -> ObjectRecords:
        """The estimates of all objects: after `continue_histories` with those of earlier drives.

        Objects that the tag database does not have any more are kept.
        """
        others = earlier.select([name not in self._tracker.objects for name in earlier.ids])
        return ObjectRecords.concatenate([others, records_of(self._tracker.objects.values())])

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """Maps, tables and the picture for the final poses `(k, 3)` of the key scans; None if no object was found."""
        found = self.found
        return result_of(found, static, path, trajectory) if found else None

    def _without(
        self, objects: Sequence[ObjectHistory], key: int, scan: PreparedScan, path: Floats
    ) -> PreparedScan:
        footprints = footprints_at_key_scan(key, scan.stamp_ns, path, objects)
        return without_points_on(scan, footprints, self._margin_m)
