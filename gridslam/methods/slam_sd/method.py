"""slam-sd: every scan is tracked by the front end; key scans go through the filter; at the end the loops are closed.

Without tag reads this is a lidar SLAM.
"""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event, LaserScan, Odometry, TagInventory, Transform
from gridslam.core.random import random_stream
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.final_stage import Refinement, refine
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.lidar_slam.track import is_far, spread_corrections, step_deviations
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.base import Estimate, RunResult, Series
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.landmarks import landmark_edges
from gridslam.methods.slam_sd.object_layer import ObjectLayer, with_objects
from gridslam.methods.slam_sd.particles import ParticleMaps
from gridslam.motion.scan_poses import PlacedScan, ScanPoses, twist_between
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]


class SlamSd:
    """Maps with a Rao-Blackwellised particle filter (the slam-sd paper); the map's origin is the pose at the first scan."""

    def __init__(self, config: SlamSdConfig, seed: int, tags: TagDatabase | None = None) -> None:
        self._config = config
        if tags is not None and config.objects.database is not None:
            raise ConfigError(
                "method.objects.database: there is a tag database in --tags as well; leave one out"
            )
        database = config.objects.database if tags is None else tags
        self._objects: ObjectLayer | None = None
        if database is not None:
            self._objects = ObjectLayer(database, config.objects, random_stream(seed, "slam-sd.objects"))
        limits = config.odometry
        self._placing = ScanPoses(
            limits.max_speed_mps, limits.max_turn_radps, limits.jump_tolerance_m, limits.jump_tolerance_rad
        )
        self._front_end = FrontEnd(config.front_end, config.odometry, config.memory_limit_mb)
        self._particles = ParticleMaps(config, random_stream(seed, "slam-sd.filter"))
        self._sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self._last: PlacedScan | None = None
        self._stamps: list[int] = []
        self._track: list[Floats] = []
        self._keys: list[int] = []
        self._key_scans: list[PreparedScan] = []
        self._diagnostics: dict[str, list[float]] = defaultdict(list)
        self._counters: Counter[str] = Counter()
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The best particle's pose at the last key scan, and all particles."""
        if not self._keys:
            return None
        poses = self._particles.poses
        return Estimate(self._stamps[self._keys[-1]], poses[self._particles.best], poses)

    def process(self, event: Event) -> None:
        """Take in extrinsics, odometry and scans; a scan is worked on when odometry has reached its stamp."""
        if isinstance(event, Odometry):
            for placed in self._placing.add_odometry(event):
                self._take(placed)
        elif isinstance(event, LaserScan):
            for placed in self._placing.add_scan(event):
                self._take(placed)
        elif isinstance(event, TagInventory):
            if self._objects is None:
                self._counters["skipped.tags.no_database"] += 1
            else:
                self._objects.add_round(event)
        elif isinstance(event, Transform) and event.is_static:
            self._sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)

    def result(self) -> RunResult:
        """Close the loops (if the final stage is enabled), draw the map, and give every scan its pose."""
        for placed in self._placing.flush():
            self._take(placed)
        config = self._config
        if not self._keys:
            return RunResult(Trajectory.empty(), counters=self._all_counters())
        key_poses = self._particles.trajectory(self._particles.best)
        if self._objects is not None:
            with self._stopwatch.stage("objects"):
                self._objects.finish(key_poses)
        measures: dict[str, object] = {
            "particles": config.particles,
            "key_scans": len(self._keys),
            "resamplings": self._particles.resamplings,
            "maps_redrawn": self._particles.rebuilds,
            "tiles_mb": round(self._particles.grids.memory_mb, 3),
        }
        resolution = config.map.resolution_m
        if config.final_stage.enabled:
            key_poses, measures["final_stage"] = self._refined(key_poses)
            resolution = config.final_stage.resolution_m or resolution
        poses = spread_corrections(np.array(self._track), np.array(self._keys), key_poses)
        trajectory = Trajectory(np.array(self._stamps, np.int64), poses)
        objects = self._objects if self._objects is not None and self._objects.found else None
        with self._stopwatch.stage("draw_map"):
            explained = None if objects is None else objects.explained(self._key_scans, key_poses)
            static = draw_map(
                self._key_scans, key_poses, resolution, config.map, config.memory_limit_mb, explained
            )
            extra = None if objects is None else objects.result(static, key_poses, trajectory)
        result = RunResult(
            trajectory,
            occupancy=static,
            series=self._series(),
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
            measures=measures,
        )
        return result if extra is None else with_objects(result, extra)

    def _refined(self, key_poses: Floats) -> tuple[Floats, dict[str, object]]:
        """The final stage's poses `(k, 3)` of the key scans, and what it tells of itself; what was moved ties nothing."""
        with self._stopwatch.stage("final_stage"):
            track = np.array(self._track)[self._keys]
            scans, landmarks = self._key_scans, None
            if self._objects is not None and self._objects.found:
                landmarks = landmark_edges(self._objects.found, key_poses)
                scans = [
                    self._objects.without_objects(key, scan, key_poses, moved_only=True)
                    for key, scan in enumerate(scans)
                ]
            config = self._config
            settings = Refinement(
                config.final_stage, config.filter, config.filter.resolution_m, config.memory_limit_mb
            )
            refined = refine(scans, key_poses, track, settings, landmarks)
            if self._objects is not None:
                self._objects.settle(refined.poses)
        moved = np.hypot(*(refined.poses - key_poses)[:, :2].T)
        return refined.poses, {
            "pairs_searched": refined.loops_tried,
            "loops_found": refined.loops_found,
            "loops_rejected": refined.loops_rejected,
            "matches": refined.matches,
            "largest_correction_m": round(float(moved.max()), 4),
        }

    def _take(self, placed: PlacedScan) -> None:
        """Track one scan; a key scan goes through the filter as well."""
        with self._stopwatch.stage("front_end"):
            scan = self._prepare(placed)
            matched = self._front_end.track(scan, placed.odometry, placed.broken)
            self._counters["scan.unmatched"] += not matched.is_matched
            self._stamps.append(scan.stamp_ns)
            self._track.append(self._front_end.pose.copy())
            self._last = placed
            if self._objects is not None:
                self._objects.place_rounds(self._stamps, self._track, self._sensor_extrinsics)
            is_key = self._is_key()
            if is_key:
                self._front_end.add_key_scan(scan)
        if is_key:
            with self._stopwatch.stage("filter"):
                self._filter(scan)
        if is_key and self._objects is not None:
            with self._stopwatch.stage("objects"):
                path = self._particles.trajectory(self._particles.best)
                self._objects.add_key_scan(scan, self._track[-1], path)
                weights = self._objects.weigh(self._particles.trajectories)
                if weights is not None:
                    self._particles.weigh_paths(weights)

    def _prepare(self, placed: PlacedScan) -> PreparedScan:
        """The scan's points, the motion during its sweep undone by the odometry since the scan before."""
        scan, twist = placed.scan, twist_between(self._last, placed)
        extrinsics = self._sensor_extrinsics.get(scan.frame_id, LidarExtrinsics(np.zeros(3)))
        prepared = prepare_scan(scan, extrinsics, twist, self._config.scan)
        self._counters["scan.empty"] += not len(prepared.points)
        return prepared

    def _is_key(self) -> bool:
        if not self._keys:
            return True
        config = self._config
        return is_far(
            self._track[self._keys[-1]], self._track[-1], config.key_distance_m, config.key_turn_rad
        )

    def _filter(self, scan: PreparedScan) -> None:
        """Predict, match, weigh, resample, update the maps: one step of the filter."""
        index = len(self._track) - 1
        step = se2.between(self._track[self._keys[-1]], self._track[index]) if self._keys else np.zeros(3)
        self._keys.append(index)
        self._key_scans.append(scan)
        particles = self._particles
        due = particles.next_inserted
        if self._objects is not None and self._objects.found and due is not None:
            path = particles.trajectory(particles.best)
            stripped = self._objects.without_objects(due, self._key_scans[due], path)
            particles.replace_scan(due, stripped)
        particles.add(scan, step, step_deviations(step, self._config.filter))
        spread = np.sqrt(np.trace(np.cov(particles.poses[:, :2].T))) if len(particles.poses) > 1 else 0.0
        self._diagnostics["effective_sample_size"].append(particles.effective_sample_size)
        self._diagnostics["particle_spread"].append(float(spread))
        self._diagnostics["tied_particles"].append(particles.ties / len(particles.poses))

    def _series(self) -> dict[str, Series]:
        stamps = np.array(self._stamps, np.int64)[self._keys]
        units = {"effective_sample_size": "particles", "particle_spread": "m", "tied_particles": "share"}
        return {name: Series(stamps, np.array(v), units[name]) for name, v in self._diagnostics.items()}

    def _all_counters(self) -> dict[str, int]:
        counters = self._counters + self._placing.counters
        if self._objects is not None:
            counters += self._objects.counters
        return {k: int(v) for k, v in counters.items()}
