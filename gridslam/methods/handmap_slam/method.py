"""handmap-slam over a log: the pose in metres from the scans (paper section 6.2), and the pose in the drawing (4, 6.1)."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event
from gridslam.core.random import random_stream
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.front_end import Tracking
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sensor_checks.odometry_check import OdometryCheck
from gridslam.maps.drawings.drawing import Drawing, drawn_map
from gridslam.matching.lines import LineSegments
from gridslam.methods.base import Estimate, RunResult, Series
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawing_report import (
    coverage_of,
    drawing_layers,
    line_table,
    measures_of,
    picture_of,
    series_of,
)
from gridslam.methods.handmap_slam.drawing_tracker import DrawingTracker, TrackedScan
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.line_front_end import LineFrontEnd
from gridslam.methods.handmap_slam.line_observation import LineObserver
from gridslam.methods.handmap_slam.metric_map import MetricMap, finish_map, surface_front_end
from gridslam.methods.handmap_slam.scan_memory import beam_endpoints
from gridslam.methods.handmap_slam.warp.laid_drawing import LaidDrawing, lay_over
from gridslam.methods.map_consistency import with_consistency
from gridslam.motion.scan_poses import PlacedScan

Floats = NDArray[np.float64]

KEY_DISTANCE_M, KEY_ANGLE_RAD = 0.25, 0.25  # motion after which a scan becomes a key scan


class HandmapSlam:
    """Maps with a drawing as prior; the map's origin is the pose at the first scan.

    The first part of the log is held back until its odometry is checked, unless `process_at_once` is called before it. Raises
    ConfigError if the start lies outside the drawing, and MapError if the drawing has no free space.
    """

    def __init__(self, config: HandmapSlamConfig, seed: int, *, drawing: Drawing) -> None:
        self._config = config
        self._seed = seed
        start = None if config.start is None else config.start[:2]
        self.drawn = drawn_map(drawing, config.drawing.walls_are, config.drawing.max_gap, start)
        self._observer = LineObserver(self.drawn)
        self._drawing_tracker = DrawingTracker(
            config,
            self.drawn,
            self._observer,
            rng=random_stream(seed, "handmap-slam.localization"),
            line_rng=random_stream(seed, "handmap-slam.lines"),
        )
        self._line_front_end: LineFrontEnd | None = None
        if config.front_end == "lines":
            likelihood = DrawnLikelihood(self.drawn, config.localization.sigma_m)
            self._line_front_end = LineFrontEnd(config, self._observer, likelihood)
        self._scan_tracker = _tracker_of(config, self._line_front_end or surface_front_end(config))
        self._stopwatch = Stopwatch()
        self._odometry_check = OdometryCheck(
            lambda: _tracker_of(config, surface_front_end(config)), self._stopwatch
        )
        self._key_drawing_poses: list[DrawingPose | None] = []

    @property
    def estimate(self) -> Estimate | None:
        """T_map_base at the last scan (m)."""
        tracker = self._scan_tracker
        if not tracker.path.stamps_ns:
            return None
        return Estimate(tracker.path.stamps_ns[-1], tracker.path.pose)

    @property
    def drawing_pose(self) -> DrawingPose | None:
        """The robot in the drawing at the last scan; None before the first scan with points."""
        return self._drawing_tracker.pose

    def process(self, event: Event) -> None:
        """Process extrinsics, odometry and scans; a scan waits until odometry is checked and has reached its stamp."""
        for checked in self._odometry_check.process(event):
            self._process(checked)

    def process_at_once(self) -> None:
        """From now on process every event as it arrives: a robot that drives by the estimate cannot wait for the check."""
        for event in self._odometry_check.flush():
            self._process(event)

    def _process(self, event: Event) -> None:
        for placed in self._scan_tracker.process(event):
            self._add_scan(placed)

    def result(self) -> RunResult:
        """Close the loops, draw the map, and report on the drawing."""
        self.process_at_once()
        for placed in self._scan_tracker.flush():
            self._add_scan(placed)
        self._scan_tracker.refuse_without_readings()
        self._scan_tracker.remove_sway()
        key_scans = self._scan_tracker.key_scans
        if not key_scans:
            return RunResult(Trajectory.empty(), counters=self._counters())
        with self._stopwatch.stage("loop_closure"):
            metric = finish_map(self._config, self._scan_tracker)
        updates = self._drawing_tracker.updates
        with self._stopwatch.stage("warp"):
            laid = self._lay_drawing_over(metric)
        with self._stopwatch.stage("report"):
            sigma_m = self._config.localization.sigma_m
            poses = (
                self._key_drawing_poses
                if laid is None or not laid.fits
                else laid.poses_at(self._scan_tracker.path.keys)
            )
            observed = coverage_of(self.drawn, key_scans, poses, sigma_m)
            picture = picture_of(self.drawn, key_scans, poses)
        result = RunResult(
            metric.trajectory,
            occupancy=metric.occupancy,
            layers=drawing_layers(self.drawn, observed),
            tables={"lines": line_table(updates, self._observer)},
            series={**series_of(updates), "inlier_ratio": self._inlier_ratio()},
            pictures={"drawing": picture},
            counters=self._counters(),
            notes=[*self._odometry_check.notes(), *self._scan_tracker.motion_notes],
            timings_s=dict(self._stopwatch.seconds),
            measures={**measures_of(self.drawn, updates, observed), **self._key_scan_measures(metric)},
            loops_ns=self._scan_tracker.path.stamps_of(metric.loops),
            untrusted_ns=self._scan_tracker.path.unmatched_ns(),
        )
        if laid is not None:
            result = laid.add_to(result)
        tracker = self._scan_tracker
        sensor_doubt = self._odometry_check.doubt or tracker.sensor_doubt(metric.loops)
        return with_consistency(result, metric.consistency, tracker.motion_doubt, sensor_doubt)

    def _lay_drawing_over(self, metric: MetricMap) -> LaidDrawing | None:
        """The drawing laid over the finished map; the paper's form has none."""
        if self._config.front_end == "lines":
            return None
        return lay_over(
            self.drawn,
            metric.occupancy,
            metric.trajectory,
            self._config,
            random_stream(self._seed, "handmap-slam.warp"),
        )

    def _inlier_ratio(self) -> Series:
        tracker = self._scan_tracker
        return Series(np.array(tracker.path.stamps_ns, np.int64), tracker.path.inlier_ratios, "fraction")

    def _add_scan(self, placed: PlacedScan) -> None:
        """Track one scan in metres, then in the drawing."""
        tracker = self._scan_tracker
        with self._stopwatch.stage("front_end"):
            endpoints = self._endpoints(placed)
            scan = tracker.prepare(placed)
            lines: LineSegments | None = None
            if self._line_front_end is not None:
                lines = self._drawing_tracker.lines_of(scan)
                self._line_front_end.lines = lines
                self._line_front_end.drawing_pose = self._drawing_tracker.pose
            tracker.track(placed, scan)
        with self._stopwatch.stage("drawing"):
            tracked = TrackedScan(scan, tracker.path.pose, len(tracker.path.poses) - 1, endpoints)
            self._drawing_tracker.add_scan(tracked, lines)
        if tracker.is_key_scan_due:
            with self._stopwatch.stage("front_end"):
                tracker.add_key_scan(scan)
            self._key_drawing_poses.append(self._drawing_tracker.pose)

    def _endpoints(self, placed: PlacedScan) -> Floats:
        """The endpoints `(m, 2)` of the scan's beams (robot's frame, m), corrected for the motion during the sweep."""
        scan = placed.scan
        extrinsics = self._scan_tracker.lidar_extrinsics(scan)
        max_range_m = self._config.scan.max_range_m
        return beam_endpoints(scan, extrinsics, self._scan_tracker.twist(placed), max_range_m).endpoints

    def _key_scan_measures(self, metric: MetricMap) -> dict[str, object]:
        tracker = self._scan_tracker
        motion = {
            **tracker.motion_measures,
            "odometry_check": self._odometry_check.measures(),
            "lidars": tracker.path.lidar_measures,
            "open_stretch": tracker.open_stretch,
        }
        measures: dict[str, object] = {"key_scans": len(tracker.path.keys), "motion": motion}
        if metric.optimised is not None:
            measures["pose_graph"] = metric.optimised.measures
        return measures

    def _counters(self) -> dict[str, int]:
        used = Counter({"used.scan": len(self._scan_tracker.path.stamps_ns)})
        counters = used + self._odometry_check.counters
        counters += self._scan_tracker.counters + self._drawing_tracker.counters
        return {name: int(count) for name, count in counters.items()}


def _tracker_of(config: HandmapSlamConfig, front_end: Tracking) -> ScanTracker:
    spacing = KeyScanSpacing(KEY_DISTANCE_M, KEY_ANGLE_RAD)
    return ScanTracker(front_end, config.scan, config.advanced.odometry, spacing)
