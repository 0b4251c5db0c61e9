"""Large places made by seed, and recorded logs, tracked by the front end: key scans, their track and their true poses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event, Odometry
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.loop_closure.trajectory import close_trajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.logs import open_log
from gridslam.motion.scan_poses import PlacedScan
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.places.build import place_document
from gridslam.simulation.places.config import Kind
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world

Floats = NDArray[np.float64]

KINDS: tuple[Kind, ...] = ("office", "corridors", "campus")
TRAVELS_M = (1000.0, 1500.0, 2000.0, 3000.0)
KEY_DISTANCE_M, KEY_ROTATION_RAD = 0.25, 0.25
MEMORY_MB = 2000.0


@dataclass(frozen=True, slots=True)
class TrackedPlace:
    """Key scans with their poses `(n, 3)`: the front end's, and the true ones."""

    scans: list[PreparedScan]
    track: Floats
    truth: Floats


def place_of(seed: int) -> tuple[Kind, float]:
    """Kind and travel (m) of the place of a seed."""
    return KINDS[seed % len(KINDS)], TRAVELS_M[seed % len(TRAVELS_M)]


def tracked_place(kind: Kind, seed: int, travel_m: float) -> TrackedPlace:
    """Drive through the place of a seed, and track the robot by the front end alone."""
    simulator = Simulator(validate_world(place_document(kind, seed, travel_m), "place"), Path())
    truth: list[tuple[int, float, float, float]] = []

    def events() -> Iterator[Event]:
        for event, is_truth in drive_route(simulator):
            if is_truth:
                assert isinstance(event, Odometry)
                truth.append((event.stamp_ns, event.x_m, event.y_m, event.yaw_rad))
            else:
                yield event

    tracker = _tracked(events())
    return TrackedPlace(tracker.key_scans, tracker.path.key_poses, _at(np.array(truth), tracker.key_scans))


def tracked_log(log: Path) -> TrackedPlace:
    """A recorded log, tracked by the front end alone; what loop closure makes of it stands for the truth."""
    with open_log(log) as source:
        tracker = _tracked(source.events())
    scans, track = tracker.key_scans, tracker.path.key_poses
    return TrackedPlace(scans, track, close_trajectory(scans, track).poses)


def _tracked(events: Iterable[Event]) -> ScanTracker:
    """A tracker that has seen all events."""
    odometry = OdometryConfig()
    spacing = KeyScanSpacing(KEY_DISTANCE_M, KEY_ROTATION_RAD)
    tracker = ScanTracker(FrontEnd(odometry, MEMORY_MB), ScanConfig(), odometry, spacing)
    for event in events:
        _track(tracker, tracker.process(event))
    _track(tracker, tracker.flush())
    return tracker


def _track(tracker: ScanTracker, placed_scans: Iterable[PlacedScan]) -> None:
    """Track these scans; those far enough from the last key scan become key scans."""
    for placed in placed_scans:
        scan = tracker.prepare(placed)
        tracker.track(placed, scan)
        if tracker.is_key_scan_due:
            tracker.add_key_scan(scan)


def _at(truth: Floats, scans: list[PreparedScan]) -> Floats:
    """True poses `(n, 3)` at the scans' stamps, linear in between."""
    start = truth[0, 0]
    stamps = np.array([scan.stamp_ns - int(start) for scan in scans], np.float64)
    times = truth[:, 0] - start
    columns = truth[:, 1], truth[:, 2], np.unwrap(truth[:, 3])
    return np.column_stack([np.interp(stamps, times, column) for column in columns])
