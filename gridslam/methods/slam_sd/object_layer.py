"""Between slam-sd and the objects: rounds get the poses of their moments, and the objects' part of the result is made."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import TagInventory
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.base import Picture, RunResult, Table
from gridslam.methods.slam_sd.composition import compose_map
from gridslam.methods.slam_sd.evidence import SeenRound, SeenScan
from gridslam.methods.slam_sd.explained import outlines_seen_from, points_on, without_objects
from gridslam.methods.slam_sd.landmarks import landmark_edges, log_object_weights
from gridslam.methods.slam_sd.object_config import ObjectsConfig
from gridslam.methods.slam_sd.object_tables import history_table, objects_table, state_of
from gridslam.methods.slam_sd.objects import ObjectTracker
from gridslam.methods.slam_sd.stays import Stay, TrackedObject
from gridslam.methods.slam_sd.things import things_of
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LONGEST_GAP_NS = 2_000_000_000  # between scans: a round in a longer one has no pose
BOX, OPEN_DOOR, CLOSED_DOOR, MOVED = (30, 110, 200), (235, 130, 20), (120, 70, 20), (205, 45, 45)


@dataclass(frozen=True, slots=True)
class ObjectResult:
    """What the objects add to a run's result."""

    maps: Mapping[str, OccupancyGrid]
    tables: Mapping[str, Table]
    pictures: Mapping[str, Picture]
    measures: Mapping[str, object]

    def added_to(self, result: RunResult) -> RunResult:
        """A run's result with its objects; the map becomes the composed one: what a robot would meet now."""
        return replace(
            result,
            occupancy=self.maps["composed"],
            maps={**result.maps, **self.maps},
            tables={**result.tables, **self.tables},
            pictures={**result.pictures, **self.pictures},
            measures={**result.measures, "objects": self.measures},
        )


class ObjectLayer(Protocol):
    """The objects of a run, as slam-sd uses them."""

    @property
    def counters(self) -> Counter[str]:
        """Rounds used and skipped, reads that were not believed."""

    @property
    def found(self) -> list[TrackedObject]:
        """The objects that have been found."""

    def add_round(self, event: TagInventory) -> None:
        """Take in one inventory round."""

    def place_rounds(
        self, stamps: Sequence[int], track: Sequence[Floats], sensor_extrinsics: Mapping[str, LidarExtrinsics]
    ) -> None:
        """Compute the antennas' poses of the waiting rounds up to the last scan."""

    def finish(self, path: Floats) -> None:
        """Process what waits at the end of the log; `path` `(k, 3)` are the poses of the key scans."""

    def update_history(self, path: Floats) -> None:
        """Decide again which objects were moved, with better poses `(k, 3)` of the key scans."""

    def landmarks(self, path: Floats) -> Edges | None:
        """Pose graph edges between key scans from which an object was found at the same place."""

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """A key scan without the endpoints on objects."""

    def without_moved_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """A key scan without the endpoints on objects that have been moved."""

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """Masks over the returns of each key scan that lie on an object; None if no object was found."""

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """Maps, tables and the picture of the objects; None if no object was found."""


class NoObjects:
    """The layer of a run without a tag database: it counts the rounds that cannot be used."""

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self.found: list[TrackedObject] = []

    def add_round(self, event: TagInventory) -> None:
        """Count the round."""
        self.counters["skipped.tags.no_database"] += 1

    def place_rounds(
        self, stamps: Sequence[int], track: Sequence[Floats], sensor_extrinsics: Mapping[str, LidarExtrinsics]
    ) -> None:
        """No round waits."""

    def finish(self, path: Floats) -> None:
        """Nothing waits."""

    def update_history(self, path: Floats) -> None:
        """Nothing was found."""

    def landmarks(self, path: Floats) -> Edges | None:
        """None."""
        return None

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """The scan itself."""
        return scan

    def without_moved_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """The scan itself."""
        return scan

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """None."""
        return None

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """None."""
        return None


class TaggedObjects:
    """Tagged objects for slam-sd; without tag reads a run is the same as without them."""

    def __init__(
        self, database: TagDatabase, config: ObjectsConfig, rng: np.random.Generator, stopwatch: Stopwatch
    ) -> None:
        self._stopwatch = stopwatch
        self._config = config
        self._tracker = ObjectTracker(things_of(database), config, rng)
        self._waiting: list[TagInventory] = []
        self._counters: Counter[str] = Counter()
        self._stamps: list[int] = []

    @property
    def counters(self) -> Counter[str]:
        """Rounds used and skipped, reads that were not believed."""
        return self._counters + self._tracker.all_counters

    @property
    def found(self) -> list[TrackedObject]:
        """The objects that have been found."""
        return [thing for thing in self._tracker.objects.values() if thing.stays]

    def add_round(self, event: TagInventory) -> None:
        """Take in one inventory round; it waits for the scan after it."""
        self._waiting.append(event)

    def place_rounds(
        self, stamps: Sequence[int], track: Sequence[Floats], sensor_extrinsics: Mapping[str, LidarExtrinsics]
    ) -> None:
        """Give the waiting rounds up to the last scan their antennas' poses, between the scans before and after."""
        due = [event for event in self._waiting if event.stamp_ns <= stamps[-1]]
        self._waiting = [event for event in self._waiting if event.stamp_ns > stamps[-1]]
        for event in due:
            extrinsics = sensor_extrinsics.get(event.frame_id)
            pose = _pose_at(event.stamp_ns, stamps, track)
            if extrinsics is None:
                self._counters["skipped.tags.no_mounting"] += 1
            elif pose is None:
                self._counters["skipped.tags.no_scan"] += 1
            else:
                self._counters["used.tags"] += 1
                antenna = se2.compose(pose, extrinsics.pose)
                self._tracker.add_round(SeenRound(event.stamp_ns, antenna, event.tag_ids))

    def add_key_scan(self, scan: PreparedScan, pose: Floats, path: Floats) -> None:
        """Take in one key scan at a pose (3,) of the front end's frame; `path` `(k, 3)` is the best particle's so far."""
        with self._stopwatch.stage("objects"):
            self._add_key_scan(scan, pose, path)

    def _add_key_scan(self, scan: PreparedScan, pose: Floats, path: Floats) -> None:
        self._tracker.add_scan(SeenScan(len(self._stamps), scan.stamp_ns, pose, scan), path)
        self._stamps.append(scan.stamp_ns)

    def log_weights(self, paths: Floats) -> Floats | None:
        """log weights `(n,)` of the particles' paths `(n, k, 3)` by the objects found again since the last call, if any."""
        pairs, self._tracker.found_again = self._tracker.found_again, []
        return log_object_weights(pairs, paths, self._config.move_probability) if pairs else None

    def finish(self, path: Floats) -> None:
        """The log is over."""
        with self._stopwatch.stage("objects"):
            self._finish(path)

    def _finish(self, path: Floats) -> None:
        self._counters["skipped.tags.no_scan"] += len(self._waiting)
        self._waiting.clear()
        self._tracker.finish(path)

    def update_history(self, path: Floats) -> None:
        """Decide anew what has moved, with better poses `(k, 3)` of the key scans."""
        self._tracker.settle(path)

    def landmarks(self, path: Floats) -> Edges | None:
        """Edges between the key scans from which an object was found at the same place."""
        return landmark_edges(self.found, path) if self.found else None

    def without_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """A key scan without the endpoints on tagged objects."""
        outlines = outlines_seen_from(key, scan.stamp_ns, path, self.found)
        return without_objects(scan, outlines, self._config.explained_m)

    def without_moved_objects(self, key: int, scan: PreparedScan, path: Floats) -> PreparedScan:
        """A key scan without the endpoints on objects that have been moved."""
        moved = [found for found in self.found if found.has_moved]
        outlines = outlines_seen_from(key, scan.stamp_ns, path, moved)
        return without_objects(scan, outlines, self._config.explained_m)

    def returns_on_objects(self, scans: Sequence[PreparedScan], path: Floats) -> list[Bools] | None:
        """Masks over the returns of each key scan that lie on an object; None if no object was found."""
        if not self.found:
            return None
        return [
            points_on(
                scan.returns,
                outlines_seen_from(key, scan.stamp_ns, path, self.found),
                self._config.explained_m,
            )
            for key, scan in enumerate(scans)
        ]

    def result(self, static: OccupancyGrid, path: Floats, trajectory: Trajectory) -> ObjectResult | None:
        """Maps, tables and the picture, for the final poses `(k, 3)` of the key scans."""
        if not self.found:
            return None
        found, limit = self.found, self._config.open_from_rad
        present = [(thing, stay) for thing in found if (stay := thing.present) is not None]
        composed = compose_map(static, [thing.thing.placed(stay.placed(path)) for thing, stay in present])
        outlines = list(self._drawn(present, path))
        picture = np.asarray(render_map(static, trajectory, outlines=outlines))
        note = "Static map; boxes blue, doors closed brown and open orange; what has moved is red."
        return ObjectResult(
            {"static": static, "composed": composed},
            {
                "objects": objects_table(found, path, limit),
                "objects_history": history_table(found, path, limit),
            },
            {"objects": Picture(picture, "Objects", note)},
            {
                "found": len(found),
                "moved": sum(thing.has_moved for thing in found),
                "gone": sum(thing.present is None for thing in found),
            },
        )

    def _drawn(
        self, present: Sequence[tuple[TrackedObject, Stay]], path: Floats
    ) -> Iterator[tuple[Floats, tuple[int, int, int], str]]:
        for thing, stay in present:
            state = state_of(stay, self._config.open_from_rad)
            colour = {"": BOX, "open": OPEN_DOOR, "closed": CLOSED_DOOR}[state]
            colour = MOVED if thing.has_moved else colour
            yield thing.thing.placed(stay.placed(path)), colour, thing.thing.id


def _pose_at(stamp_ns: int, stamps: Sequence[int], track: Sequence[Floats]) -> Floats | None:
    """The front end's pose between two scans; None before the first, and in a long gap."""
    after = bisect_left(stamps, stamp_ns, max(len(stamps) - 100, 0))
    if after >= len(stamps) or (after == 0 and stamps[0] != stamp_ns):
        return None
    if stamps[after] == stamp_ns:
        return track[after]
    span = stamps[after] - stamps[after - 1]
    if not 0 < span < LONGEST_GAP_NS or stamp_ns < stamps[after - 1]:
        return None
    return se2.interpolate(track[after - 1], track[after], (stamp_ns - stamps[after - 1]) / span)
