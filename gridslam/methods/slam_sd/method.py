"""slam-sd: the front end tracks every scan, the filter takes the key scans, and at the end loops are closed.

Without tag reads this is a lidar SLAM.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.core.memory import return_freed_memory
from gridslam.core.messages import Event, TagInventory
from gridslam.core.random import random_stream
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing, StepNoise
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sensor_checks.odometry_check import OdometryCheck
from gridslam.lidar_slam.sessions.session import Session
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.base import Estimate, RunResult, Series
from gridslam.methods.map_consistency import with_consistency
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.drive_closing import DriveClosing
from gridslam.methods.slam_sd.objects.object_layer import NoObjects, ObjectLayer
from gridslam.methods.slam_sd.objects.tagged_objects import TaggedObjects
from gridslam.methods.slam_sd.particle_filter import ParticleFilter
from gridslam.methods.slam_sd.session_result import (
    with_drives,
)
from gridslam.methods.slam_sd.single_track import SingleTrack
from gridslam.motion.scan_poses import PlacedScan

Floats = NDArray[np.float64]

STEP_NOISE = StepNoise()
DIAGNOSTIC_UNITS = {
    "effective_sample_size": "particles",
    "particle_std": "m",
    "matched_particles": "fraction",
}


class SlamSd:
    """Maps with a Rao-Blackwellised particle filter (the slam-sd paper); the map's origin is the pose at the first scan.

    Raises ConfigError if two tag databases are given.
    """

    def __init__(
        self,
        config: SlamSdConfig,
        seed: int,
        tags: TagDatabase | None = None,
        session: Session | None = None,
        log_name: str = "log",
    ) -> None:
        if session is not None and not config.pose_graph.enabled:
            raise ConfigError(
                "method.pose_graph.enabled: false, but a session is continued by loop closure alone"
            )
        self._config = config
        self._session, self._log_name = session, log_name
        self._stopwatch = Stopwatch()
        self._tracker = _tracker_of(config)
        self._odometry_check = OdometryCheck(partial(_tracker_of, config), self._stopwatch)
        self._objects = self._object_layer(tags, seed)
        self._filter = self._path_filter(seed)
        self._diagnostics: dict[str, list[float]] = defaultdict(list)

    @property
    def estimate(self) -> Estimate | None:
        """The best particle's pose at the last key scan, and all particles."""
        keys = self._tracker.path.keys
        if not keys:
            return None
        poses = self._filter.poses
        return Estimate(self._tracker.path.stamps_ns[keys[-1]], poses[self._filter.best], poses)

    def process(self, event: Event) -> None:
        """Process an event; a scan is processed once odometry is checked and has reached its stamp."""
        for checked in self._odometry_check.process(event):
            self._process(checked)

    def _process(self, event: Event) -> None:
        if isinstance(event, TagInventory):
            self._objects.add_round(event)
        for placed in self._tracker.process(event):
            self._process_scan(placed)

    def result(self) -> RunResult:
        """Close the loops (unless disabled), draw the map, and give every scan its pose."""
        for event in self._odometry_check.flush():
            self._process(event)
        for placed in self._tracker.flush():
            self._process_scan(placed)
        self._tracker.refuse_without_readings()
        self._tracker.remove_sway()
        if not self._tracker.path.keys:
            return RunResult(Trajectory.empty(), counters=self._counters())
        self._objects.finish(self._filter.best_trajectory)
        closing = DriveClosing(
            config=self._config,
            tracker=self._tracker,
            objects=self._objects,
            stopwatch=self._stopwatch,
            session=self._session,
            log_name=self._log_name,
        )
        drive = closing.closed(self._filter.best_trajectory)
        consistency = closing.assessed(drive)
        return_freed_memory()
        tracker = self._tracker
        trajectory = tracker.corrected(drive.poses)
        # The file of a first drive's session is written before the map is drawn, so that the scans make room for its pictures.
        session_file = closing.session_file(drive) if drive.continued is None else None
        static, drawn, objects = closing.drawn(drive, trajectory)
        if drive.continued is not None:
            session_file = closing.session_file(drive, drawn)
        drive = replace(drive, session=None)
        tracker.forget_key_scans()
        result = RunResult(
            trajectory,
            occupancy=static,
            series=self._series(),
            counters=self._counters(),
            notes=[*self._odometry_check.notes(), *tracker.motion_notes],
            measures={**self._measures(), **drive.measures},
            loops_ns=tracker.path.stamps_of(drive.loops),
            untrusted_ns=tracker.path.unmatched_ns(),
        )
        return_freed_memory()
        with self._stopwatch.stage("map_consistency"):
            sensor_doubt = self._odometry_check.doubt or tracker.sensor_doubt(drive.loops)
            result = with_consistency(result, consistency, tracker.motion_doubt, sensor_doubt)
        if drive.continued is not None and drawn is not None:
            result = with_drives(result, drive.continued, drawn)
        return_freed_memory()
        if session_file is not None:
            result = session_file.added_to(result)
        result = replace(result, timings_s=dict(self._stopwatch.seconds))
        return result if objects is None else objects.added_to(result)

    def _measures(self) -> dict[str, object]:
        """Numbers about tracking and filter, for the report."""
        particles, tracker = self._filter, self._tracker
        return {
            "particles": len(particles.poses),
            "key_scans": len(tracker.path.keys),
            "resamplings": particles.resamplings,
            "maps_redrawn": particles.redrawn_maps,
            "tiles_mb": round(particles.memory_mb, 3),
            "motion": {
                **tracker.motion_measures,
                "odometry_check": self._odometry_check.measures(),
                "lidars": tracker.path.lidar_measures,
                "open_stretch": tracker.open_stretch,
            },
        }

    def _object_layer(self, tags: TagDatabase | None, seed: int) -> ObjectLayer:
        """The layer of tagged objects, if there is a tag database."""
        config = self._config
        if tags is not None and config.objects.database is not None:
            raise ConfigError(
                "method.objects.database: --tags gives a tag database as well; leave out one of the two"
            )
        database = config.objects.database if tags is None else tags
        if database is None:
            return NoObjects()
        rng = random_stream(seed, "slam-sd.objects")
        return TaggedObjects(database, config.objects, config.advanced.objects, rng, self._stopwatch)

    def _path_filter(self, seed: int) -> ParticleFilter | SingleTrack:
        """The particle filter, where its result is used: loop closure starts from the front end's track."""
        config = self._config
        is_needed = not config.pose_graph.enabled or self._objects.may_find
        if not is_needed and config.advanced.filter.run == "needed":
            return SingleTrack()
        return ParticleFilter(
            config.particles,
            config.advanced.filter,
            config.memory_limit_mb,
            random_stream(seed, "slam-sd.filter"),
        )

    def _process_scan(self, placed: PlacedScan) -> None:
        """Track one scan; a key scan also goes through the filter and to the objects."""
        tracker = self._tracker
        with self._stopwatch.stage("front_end"):
            scan = tracker.prepare(placed)
            tracker.track(placed, scan)
            self._objects.place_rounds(tracker.path.stamps_ns, tracker.path.poses, tracker.sensor_extrinsics)
            if not tracker.is_key_scan_due:
                return
            step = tracker.add_key_scan(scan)
        with self._stopwatch.stage("filter"):
            self._remove_objects_from_next_insertion()
            self._filter.add_key_scan(scan, step, STEP_NOISE.std(step))
            self._record_diagnostics()
        self._update_objects(scan)

    def _remove_objects_from_next_insertion(self) -> None:
        """Remove the endpoints on tagged objects from the key scan that enters the particles' maps next."""
        key = self._filter.next_inserted
        if key is not None and self._objects.found:
            scan = self._tracker.key_scans[key]
            self._filter.replace_scan(
                key, self._objects.without_objects(key, scan, self._filter.best_trajectory)
            )

    def _update_objects(self, scan: PreparedScan) -> None:
        """Give the key scan to the objects, and weight the particles by the objects that were found again."""
        self._objects.add_key_scan(scan, self._tracker.path.pose, self._filter.best_trajectory)
        weights = self._objects.log_weights(self._filter.trajectories) if self._objects.may_find else None
        if weights is not None:
            self._filter.add_evidence(weights)

    def _record_diagnostics(self) -> None:
        for name, value in self._filter.diagnostics.items():
            self._diagnostics[name].append(value)

    def _series(self) -> dict[str, Series]:
        tracker = self._tracker
        stamps = tracker.path.key_stamps_ns
        found = {
            name: Series(stamps, np.array(values), DIAGNOSTIC_UNITS[name])
            for name, values in self._diagnostics.items()
        }
        return {
            **found,
            "inlier_ratio": Series(
                np.array(tracker.path.stamps_ns, np.int64), tracker.path.inlier_ratios, "fraction"
            ),
        }

    def _counters(self) -> dict[str, int]:
        counters = self._odometry_check.counters + self._tracker.counters + self._objects.counters
        return {name: int(count) for name, count in counters.items()}


def _tracker_of(config: SlamSdConfig) -> ScanTracker:
    """A tracker that has seen nothing."""
    odometry = config.advanced.odometry
    spacing = KeyScanSpacing(config.key_distance_m, config.key_rotation_rad)
    return ScanTracker(FrontEnd(odometry, config.memory_limit_mb), config.scan, odometry, spacing)
