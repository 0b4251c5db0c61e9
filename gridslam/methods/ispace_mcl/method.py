"""Monte Carlo localization along a log (ispace-mcl), with fixed cameras where the log has them."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import CameraInfo, DepthImage, Event, Image, LaserScan, Odometry, Transform
from gridslam.core.random import random_stream
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.odometry_noise import JUMP_TOLERANCE_M, JUMP_TOLERANCE_RAD
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sensor_checks.odometry_check import OdometryCheck
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Doubt, Estimate, Picture, RunResult
from gridslam.methods.ispace_mcl.cameras.fixed_cameras import (
    DENSITY_MAX_AGE_S,
    MAX_AGE_S,
    FixedCameras,
    detection_parameters,
)
from gridslam.methods.ispace_mcl.cameras.onboard_depth import MAX_DEPTH_M, OnboardDepth
from gridslam.methods.ispace_mcl.cameras.pictures import coverage_picture
from gridslam.methods.ispace_mcl.confidence import FilterUpdate
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.doubt import doubt_of
from gridslam.methods.ispace_mcl.localizer import Localizer
from gridslam.methods.ispace_mcl.record import LocalizationHistory
from gridslam.motion.odometry_limits import OdometryLimits
from gridslam.motion.scan_poses import PlacedScan, ScanPoses
from gridslam.sensors.depth_ranges import DepthBand
from gridslam.sensors.floor_cells import FreeFloor
from gridslam.sensors.lidar_beams import LidarExtrinsics, beams_of, extrinsics_of

Floats = NDArray[np.float64]

MAX_YAW_RATE_RADPS = 10.0  # odometry that rotates faster has jumped
# Distance (m) and rotation (rad) between the key scans of the odometry check
CHECK_SPACING = KeyScanSpacing(distance_m=0.25, rotation_rad=0.25)
CHECK_MEMORY_MB = 500.0
CHECK_IMAGES_BYTES = 100_000_000  # held back until the odometry is checked; with more the check ends early
# Further updates while the robot has not moved since the start or a jump: they help the global search, but more scans of one
# view add no evidence.
MAX_STANDING_UPDATES = 3


class IspaceMcl:
    """Localizes a robot on the map `occupancy`, with a pose for every scan that the odometry covers."""

    def __init__(self, config: IspaceMclConfig, seed: int, occupancy: OccupancyGrid) -> None:
        self._config = config
        advanced = config.advanced
        detection = detection_parameters(advanced.camera_background)
        self._localizer = Localizer(config, occupancy, random_stream(seed, "localizer"))
        self._scans = ScanPoses(
            OdometryLimits(advanced.max_speed_mps, MAX_YAW_RATE_RADPS, JUMP_TOLERANCE_M, JUMP_TOLERANCE_RAD)
        )
        self._odometry_check = OdometryCheck(_tracker, self._localizer.stopwatch)
        self._seen_bytes = 0  # of images
        self._sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self._depth = OnboardDepth(
            DepthBand(advanced.depth_min_height_m, advanced.depth_max_height_m, MAX_DEPTH_M),
            advanced.camera_root_frame,
        )
        self._uses_density = advanced.camera_weight != "detection"
        self.cameras = FixedCameras(
            advanced.camera_root_frame,
            FreeFloor(occupancy, advanced.free_threshold, detection.cell_m),
            detection,
            DENSITY_MAX_AGE_S if self._uses_density else MAX_AGE_S,
        )
        self._occupancy = occupancy
        self._history = LocalizationHistory()
        self._counters: Counter[str] = Counter()
        self._odometry_at_update: Floats | None = None  # T_odom_base of the last update
        self._update: FilterUpdate | None = None
        self._standing = 0  # scans without motion since the start, or since the odometry has jumped
        self._beam_count: int | None = None
        self._stamp_ns = 0
        self._pose: Floats | None = None

    @property
    def estimate(self) -> Estimate | None:
        """The latest pose and all particles; None until a first scan is localized (scans wait for the odometry check)."""
        if self._pose is None:
            return None
        return Estimate(self._stamp_ns, self._pose, self._localizer.particles.poses)

    def process(self, event: Event) -> None:
        """Process a scan, odometry, a static transform, or an image, depth image or calibration of a camera.

        Events wait until odometry is checked, or until the images among them take too much memory.
        """
        if isinstance(event, Image | DepthImage):
            self._seen_bytes += (event.pixels if isinstance(event, Image) else event.depth_m).nbytes
            if self._seen_bytes > CHECK_IMAGES_BYTES:
                self._end_odometry_check()
        for checked in self._odometry_check.process(event):
            self._process(checked)

    def _end_odometry_check(self) -> None:
        for event in self._odometry_check.flush():
            self._process(event)

    def _process(self, event: Event) -> None:
        if isinstance(event, LaserScan):
            for depth in self._depth.lidar_found():
                self._process_camera_event(depth)
            self._process_scan(event)
        elif isinstance(event, Odometry):
            for placed in self._scans.add_odometry(event):
                self._localize(placed)
        elif isinstance(event, Transform):
            if event.is_static:
                self._sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)
                self.cameras.add_extrinsics(event)
                self._depth.add_extrinsics(event)
        elif isinstance(event, DepthImage) and self._depth.accepts(event.frame_id):
            for scan in self._depth.add(event):
                self._process_scan(scan)
        else:
            self._process_camera_event(event)

    def _process_scan(self, scan: LaserScan) -> None:
        for placed in self._scans.add_scan(scan):
            self._localize(placed)

    def _process_camera_event(self, event: Event) -> None:
        if isinstance(event, CameraInfo):
            self._depth.add_info(event)
        if self._config.cameras.enabled:
            with self._localizer.stopwatch.stage("cameras"):
                self._add_to_cameras(event)

    def _add_to_cameras(self, event: Event) -> None:
        if isinstance(event, Image | DepthImage):
            self.cameras.add_image(event)
        elif isinstance(event, CameraInfo):
            self.cameras.add_info(event)

    def result(self) -> RunResult:
        """Finish the run: process the events still held back, and return the trajectory with everything for the report."""
        self._end_odometry_check()
        for scan in self._depth.flush():
            self._process_scan(scan)
        self._depth.check()
        for placed in self._scans.flush():
            self._localize(placed)
        self.cameras.finish()
        counters = self._counters + self._localizer.counters + self._scans.counters
        counters += self.cameras.counters + self._depth.counters + self._odometry_check.counters
        path = self._history.trajectory()
        series = self._history.series()
        return RunResult(
            path,
            pictures=self._pictures(path),
            tables={"localization": self._history.table()},
            series=series,
            position_std=series["particle_std"],
            untrusted_ns=self._history.untrusted_ns(),
            counters=dict(counters),
            notes=[*self._odometry_check.notes(), *self.cameras.notes()],
            timings_s=dict(self._localizer.stopwatch.seconds),
            measures={
                **self._history.measures(),
                **self._camera_measures(),
                "motion": {"odometry_check": self._odometry_check.measures()},
            },
            doubt=self._doubt(),
        )

    def _doubt(self) -> Doubt | None:
        occupied_threshold = self._config.advanced.occupied_threshold
        return doubt_of(self._history, self._occupancy, occupied_threshold, self._localizer.is_map_mirrored)

    def _pictures(self, path: Trajectory) -> dict[str, Picture]:
        coverage = self.cameras.coverage()
        if not len(coverage):
            return {}
        untrusted = self._history.is_untrusted()
        return {
            "cameras": coverage_picture(self._occupancy, coverage, self.cameras.moving(), path, untrusted)
        }

    def _camera_measures(self) -> dict[str, object]:
        measures = self.cameras.measures()
        return {"cameras": measures} if measures else {}

    def _localize(self, placed: PlacedScan) -> None:
        beams = len(placed.scan.ranges_m)
        if self._beam_count not in (None, beams):
            self._counters["scan.beam_count_changes"] += 1
        self._beam_count = beams
        self.cameras.add_pose(placed.scan.stamp_ns, placed.odometry, placed.odometry_jumped)
        if self._is_update_due(placed):
            self._weigh(placed)
        if self._update is None or self._odometry_at_update is None:
            return
        since = se2.between(self._odometry_at_update, placed.odometry)
        self._pose = se2.compose(self._update.belief.mean, since)
        self._stamp_ns = placed.scan.stamp_ns
        self._history.add(self._stamp_ns, self._pose, placed.odometry, self._update)
        self._counters["used.scan"] += 1

    def _is_update_due(self, placed: PlacedScan) -> bool:
        if self._odometry_at_update is None or placed.odometry_jumped:
            self._standing = 0
            return True
        step = se2.between(self._odometry_at_update, placed.odometry)
        advanced = self._config.advanced
        moved = float(np.hypot(step[0], step[1])) >= advanced.update_distance_m
        if moved or abs(float(step[2])) >= advanced.update_angle_rad:
            return True
        self._standing += 1
        return self._standing <= MAX_STANDING_UPDATES

    def _weigh(self, placed: PlacedScan) -> None:
        frame = placed.scan.frame_id
        extrinsics = self._depth.sensor_extrinsics.get(frame) or self._sensor_extrinsics.get(
            frame, LidarExtrinsics(np.zeros(3))
        )
        beams = beams_of(
            placed.scan, extrinsics, self._config.advanced.min_range_m, self._config.scan.max_range_m
        )
        self._counters["beams.unreadable"] += beams.unreadable
        last = placed.odometry if self._odometry_at_update is None else self._odometry_at_update
        step = se2.between(last, placed.odometry)
        # The paper's density is that of all moving points at a moment, so it needs the latest frame of every camera.
        cameras = self.cameras
        observations_at = cameras.all_observations_at if self._uses_density else cameras.observations_at
        observations = observations_at(placed.scan.stamp_ns)
        self._update = self._localizer.update(
            step, placed.odometry, beams, placed.odometry_jumped, observations
        )
        self._odometry_at_update = placed.odometry
        self._counters["updates"] += 1
        if not self._uses_density and self._update.assessment.status == "localized":
            self.cameras.learn_extrinsics(self._update.belief.mean)


def _tracker() -> ScanTracker:
    """The tracker that follows the first scans without using odometry, so that the odometry can be checked against it."""
    odometry = OdometryConfig()
    return ScanTracker(FrontEnd(odometry, CHECK_MEMORY_MB), ScanConfig(), odometry, CHECK_SPACING)
