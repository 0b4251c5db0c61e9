"""Monte Carlo localization along a log (ispace-mcl), with fixed cameras where the log has them."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import CameraInfo, DepthImage, Event, Image, LaserScan, Odometry, Transform
from gridslam.core.random import random_stream
from gridslam.core.trajectory import Trajectory
from gridslam.filters.free_space import free_cells
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Estimate, Picture, RunResult
from gridslam.methods.ispace_mcl.camera_config import DensityConfig
from gridslam.methods.ispace_mcl.cameras import Cameras
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.localizer import Localizer, Update
from gridslam.methods.ispace_mcl.onboard_depth import OnboardDepth
from gridslam.methods.ispace_mcl.pictures import coverage_picture
from gridslam.methods.ispace_mcl.record import Record
from gridslam.motion.odometry_limits import OdometryLimits
from gridslam.motion.scan_poses import PlacedScan, ScanPoses
from gridslam.sensors.lidar_beams import LidarExtrinsics, beams_of, extrinsics_of

Floats = NDArray[np.float64]


class IspaceMcl:
    """Finds the robot on `occupancy`, a pose for every scan that odometry reaches."""

    def __init__(self, config: IspaceMclConfig, seed: int, occupancy: OccupancyGrid) -> None:
        self._config = config
        self._localizer = Localizer(config, occupancy, random_stream(seed, "localizer"))
        motion = config.motion
        self._scans = ScanPoses(
            OdometryLimits(motion.max_speed_mps, motion.max_turn_radps, motion.jump_m, motion.jump_rad)
        )
        self._sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self._depth = OnboardDepth(config.scan.depth, config.cameras.frame)
        free = free_cells(occupancy, config.free_below)
        self._cameras = Cameras(config.cameras, floor_cells(free, occupancy, config.cameras.cell_m))
        self._occupancy = occupancy
        self._record = Record()
        self._counters: Counter[str] = Counter()
        self._updated_at: Floats | None = None  # T_odom_base of the last update
        self._update: Update | None = None
        self._standing = 0
        self._beam_count: int | None = None
        self._stamp_ns = 0
        self._pose: Floats | None = None

    @property
    def estimate(self) -> Estimate | None:
        """The mean of the main cluster, and all particles."""
        if self._pose is None:
            return None
        return Estimate(self._stamp_ns, self._pose, self._localizer.particles.poses)

    def process(self, event: Event) -> None:
        """Scans, odometry, static transforms, and images, depths and calibrations of fixed cameras are used."""
        if isinstance(event, LaserScan):
            for depth in self._depth.lidar_came():
                self._take_picture(depth)
            self._take_scan(event)
        elif isinstance(event, Odometry):
            for placed in self._scans.add_odometry(event):
                self._take(placed)
        elif isinstance(event, Transform):
            if event.is_static:
                self._sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)
                self._cameras.add_extrinsics(event)
                self._depth.add_extrinsics(event)
        elif isinstance(event, DepthImage) and self._depth.takes(event.frame_id):
            for scan in self._depth.add(event):
                self._take_scan(scan)
        else:
            self._take_picture(event)

    def _take_scan(self, scan: LaserScan) -> None:
        for placed in self._scans.add_scan(scan):
            self._take(placed)

    def _take_picture(self, event: Event) -> None:
        if isinstance(event, CameraInfo):
            self._depth.add_info(event)
        if self._config.cameras.enabled:
            with self._localizer.stopwatch.stage("cameras"):
                self._show_cameras(event)

    def _show_cameras(self, event: Event) -> None:
        if isinstance(event, Image):
            self._cameras.add_image(event)
        elif isinstance(event, DepthImage):
            self._cameras.add_depth(event)
        elif isinstance(event, CameraInfo):
            self._cameras.add_info(event)

    def result(self) -> RunResult:
        """The trajectory, the table `localization` and the series of the report."""
        for scan in self._depth.flush():
            self._take_scan(scan)
        self._depth.check()
        for placed in self._scans.flush():
            self._take(placed)
        self._cameras.finish()
        counters = self._counters + self._localizer.counters + self._scans.counters
        counters += self._cameras.counters + self._depth.counters
        path = self._record.trajectory()
        return RunResult(
            path,
            pictures=self._pictures(path),
            tables={"localization": self._record.table()},
            series=self._record.series(),
            counters=dict(counters),
            timings_s=dict(self._localizer.stopwatch.seconds),
            measures={**self._record.measures(), **self._camera_measures()},
        )

    def _pictures(self, path: Trajectory) -> dict[str, Picture]:
        coverage = self._cameras.coverage()
        if not len(coverage):
            return {}
        moving, cell_m = self._cameras.moving(), self._config.cameras.cell_m
        return {"cameras": coverage_picture(self._occupancy, coverage, moving, cell_m, path)}

    def _camera_measures(self) -> dict[str, object]:
        measures = self._cameras.measures()
        return {"cameras": measures} if measures else {}

    def _take(self, placed: PlacedScan) -> None:
        beams = len(placed.scan.ranges_m)
        if self._beam_count not in (None, beams):
            self._counters["scan.beam_count_changes"] += 1
        self._beam_count = beams
        self._cameras.add_pose(placed.scan.stamp_ns, placed.odometry, placed.odometry_jumped)
        if self._is_update_due(placed):
            self._weigh(placed)
        if self._update is None or self._updated_at is None:
            return
        since = se2.between(self._updated_at, placed.odometry)
        self._pose = se2.compose(self._update.belief.mean, since)
        self._stamp_ns = placed.scan.stamp_ns
        self._record.add(self._stamp_ns, self._pose, self._update)
        self._counters["used.scan"] += 1

    def _is_update_due(self, placed: PlacedScan) -> bool:
        if self._updated_at is None or placed.odometry_jumped:
            return True
        step = se2.between(self._updated_at, placed.odometry)
        config = self._config.update
        moved = float(np.hypot(step[0], step[1])) >= config.min_travel_m
        if moved or abs(float(step[2])) >= config.min_turn_rad:
            self._standing = 0
            return True
        self._standing += 1
        return self._standing <= config.standing

    def _weigh(self, placed: PlacedScan) -> None:
        config = self._config.scan
        frame = placed.scan.frame_id
        extrinsics = self._depth.sensor_extrinsics.get(frame) or self._sensor_extrinsics.get(
            frame, LidarExtrinsics(np.zeros(3))
        )
        beams = beams_of(placed.scan, extrinsics, config.min_range_m, config.max_range_m)
        self._counters["beams.unreadable"] += beams.unreadable
        last = placed.odometry if self._updated_at is None else self._updated_at
        step = se2.between(last, placed.odometry)
        density = isinstance(self._config.cameras.weight, DensityConfig)  # of all that is seen at a moment
        frames_at = self._cameras.all_frames_at if density else self._cameras.frames_at
        frames = frames_at(placed.scan.stamp_ns)
        self._update = self._localizer.update(step, placed.odometry, beams, placed.odometry_jumped, frames)
        self._updated_at = placed.odometry
        self._counters["updates"] += 1


def floor_cells(free: NDArray[np.bool_], occupancy: OccupancyGrid, cell_m: float) -> Floats:
    """Centres `(k, 2)` of the cells of a raster of `cell_m` in which the map has free space."""
    centres = occupancy.geometry.centres(np.argwhere(free))
    return np.asarray((np.unique(np.floor(centres / cell_m), axis=0) + 0.5) * cell_m)
