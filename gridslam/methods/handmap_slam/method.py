"""handmap-slam along a log: the pose in metres from the scans (6.2), the pose in the drawing beside it (4, 6.1)."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.core.random import random_stream
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.odometry_noise import odometry_limits
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.maps.drawing import Drawing, drawn_map
from gridslam.matching.lines import Segments
from gridslam.methods.base import Estimate, RunResult
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawing_tracker import DrawingTracker
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.line_front_end import LineFrontEnd
from gridslam.methods.handmap_slam.line_observation import LineObserver
from gridslam.methods.handmap_slam.metric_map import Finished, finish_map, surface_front_end
from gridslam.methods.handmap_slam.outcome import (
    coverage_of,
    drawing_layers,
    line_table,
    measures_of,
    picture_of,
    series_of,
)
from gridslam.methods.handmap_slam.seen_scans import seen_scan
from gridslam.motion.scan_poses import PlacedScan, ScanPoses, twist_between
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]


class HandmapSlam:
    """Maps with a drawing as prior; the map's origin is the pose at the first scan.

    Raises ConfigError: the start lies outside of the drawing. MapError: the drawing has no free space.
    """

    def __init__(self, config: HandmapSlamConfig, seed: int, *, drawing: Drawing) -> None:
        self._config = config
        reading = config.drawing
        start = None if config.start is None else config.start[:2]
        self.drawn = drawn_map(drawing, reading.walls_are, reading.gap_m, start)
        self._placing = ScanPoses(odometry_limits(config.odometry))
        observer = LineObserver(self.drawn, config.lines)
        self._observer = observer
        self._tracker = DrawingTracker(
            config,
            self.drawn,
            observer,
            random_stream(seed, "handmap-slam.localization"),
            random_stream(seed, "handmap-slam.lines"),
        )
        self._line_front_end: LineFrontEnd | None = None
        if config.front_end == "lines":
            local = config.localization
            likelihood = DrawnLikelihood(self.drawn, local.sigma_m, local.random_share)
            self._line_front_end = LineFrontEnd(config, observer, likelihood)
        self._front_end = self._line_front_end or surface_front_end(config)
        self._sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self._last: PlacedScan | None = None
        self._stamps: list[int] = []
        self._track: list[Floats] = []
        self._keys: list[int] = []
        self._key_scans: list[PreparedScan] = []
        self._key_drawing_poses: list[DrawingPose | None] = []
        self._counters: Counter[str] = Counter()
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """T_map_base at the last scan, in metres."""
        if not self._track:
            return None
        return Estimate(self._stamps[-1], self._track[-1])

    @property
    def drawing_pose(self) -> DrawingPose | None:
        """The robot in the drawing at the last scan; None before the first scan with points."""
        return self._tracker.pose

    def process(self, event: Event) -> None:
        """Take in extrinsics, odometry and scans; a scan is worked on when odometry has reached its stamp."""
        if isinstance(event, Odometry):
            for placed in self._placing.add_odometry(event):
                self._take(placed)
        elif isinstance(event, LaserScan):
            for placed in self._placing.add_scan(event):
                self._take(placed)
        elif isinstance(event, Transform) and event.is_static:
            self._sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)

    def result(self) -> RunResult:
        """Close the loops, draw the map, and tell what became of the drawing."""
        for placed in self._placing.flush():
            self._take(placed)
        if not self._keys:
            return RunResult(Trajectory.empty(), counters=self._all_counters())
        with self._stopwatch.stage("loop_closure"):
            finished = finish_map(
                self._config, self._key_scans, np.array(self._track), np.array(self._keys, np.int64)
            )
        updates = self._tracker.updates
        with self._stopwatch.stage("tell"):
            seen = coverage_of(
                self.drawn, self._key_scans, self._key_drawing_poses, self._config.localization.sigma_m
            )
            picture = picture_of(self.drawn, updates, self._key_scans, self._key_drawing_poses)
        return RunResult(
            Trajectory(np.array(self._stamps, np.int64), finished.poses),
            occupancy=finished.occupancy,
            layers=drawing_layers(self.drawn, seen),
            tables={"lines": line_table(updates, self._observer)},
            series=series_of(updates),
            pictures={"drawing": picture},
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
            measures={**measures_of(self.drawn, updates, seen), **self._own_measures(finished)},
        )

    def _take(self, placed: PlacedScan) -> None:
        """Track one scan in metres, then in the drawing."""
        with self._stopwatch.stage("front_end"):
            scan, beam_ends = self._prepare(placed)
            lines: Segments | None = None
            if self._line_front_end is not None:
                lines = self._tracker.lines_of(scan)
                self._line_front_end.lines = lines
                self._line_front_end.drawing_pose = self._tracker.pose
            matched = self._front_end.track(scan, placed.odometry, placed.odometry_jumped)
            self._counters["scan.unmatched"] += not matched.is_matched
            self._counters["used.scan"] += 1
            self._stamps.append(scan.stamp_ns)
            self._track.append(self._front_end.pose.copy())
            self._last = placed
        with self._stopwatch.stage("drawing"):
            self._tracker.take(scan, self._track[-1], len(self._track) - 1, beam_ends, lines)
        if self._is_key():
            with self._stopwatch.stage("front_end"):
                self._front_end.add_key_scan(scan)
            self._keys.append(len(self._track) - 1)
            self._key_scans.append(scan)
            self._key_drawing_poses.append(self._tracker.pose)

    def _prepare(self, placed: PlacedScan) -> tuple[PreparedScan, Floats]:
        """The scan's points and where its beams end, the motion during its sweep undone by the odometry since the scan before."""
        scan, twist = placed.scan, twist_between(self._last, placed)
        extrinsics = self._sensor_extrinsics.get(scan.frame_id, LidarExtrinsics(np.zeros(3)))
        prepared = prepare_scan(scan, extrinsics, twist, self._config.scan)
        self._counters["scan.empty"] += not len(prepared.points)
        return prepared, seen_scan(scan, extrinsics, twist, self._config.scan.max_range_m).ends

    def _is_key(self) -> bool:
        if not self._keys:
            return True
        config = self._config
        spacing = KeyScanSpacing(config.key_distance_m, config.key_turn_rad)
        return spacing.is_due(self._track[self._keys[-1]], self._track[-1])

    def _own_measures(self, finished: Finished) -> dict[str, object]:
        measures: dict[str, object] = {"key_scans": len(self._keys)}
        if finished.optimised is not None:
            measures["pose_graph"] = finished.optimised.measures
        return measures

    def _all_counters(self) -> dict[str, int]:
        return {
            k: int(v) for k, v in (self._counters + self._placing.counters + self._tracker.counters).items()
        }
