"""Scans for a robot without a lidar, made from the images of its depth camera."""

from __future__ import annotations

from collections import Counter, deque

import numpy as np

from gridslam.core.errors import MethodError
from gridslam.core.messages import CameraInfo, DepthImage, LaserScan, Transform
from gridslam.sensors.depth_ranges import DepthBand, depth_scan, planar_extrinsics, ranges_frame
from gridslam.sensors.lidar_beams import LidarExtrinsics
from gridslam.sensors.pinhole import Pinhole

MAX_DEPTH_M = 5.0  # depths beyond this are too coarse
LIDAR_WAIT_S = 2.0  # a log without a scan for this long has no lidar


class OnboardDepth:
    """Converts the depth images of a camera on the robot to scans, if the log has no lidar.

    Depth images of the first `LIDAR_WAIT_S` wait until it is clear whether there is a lidar; the first scan discards them.
    """

    def __init__(self, band: DepthBand, fixed_frame: str) -> None:
        self._fixed_frame = fixed_frame
        self._band = band
        self._transforms: dict[str, Transform] = {}
        self._infos: dict[str, CameraInfo] = {}
        self._waiting: deque[DepthImage] = deque()
        self._first_ns: int | None = None
        self._camera: str | None = None
        self._has_lidar = False
        self.sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self.counters: Counter[str] = Counter()

    def add_extrinsics(self, transform: Transform) -> None:
        """Store the static transform of a sensor."""
        self._transforms[transform.child_frame_id] = transform

    def add_info(self, info: CameraInfo) -> None:
        """Store a calibration; one that is not finite, or has no focal length, is ignored."""
        if np.isfinite(info.K).all() and info.K[0, 0] > 0.0 and info.K[1, 1] > 0.0:
            self._infos.setdefault(info.frame_id, info)

    def accepts(self, frame: str) -> bool:
        """Whether depth images of this frame become scans: a camera on the robot, in a log without a lidar."""
        extrinsics = self._transforms.get(frame)
        return not self._has_lidar and extrinsics is not None and extrinsics.frame_id != self._fixed_frame

    def lidar_found(self) -> list[DepthImage]:
        """Use the lidar from now on; returns the depth images that have waited, which may be those of fixed cameras."""
        self._has_lidar = True
        returned = list(self._waiting)
        self._waiting.clear()
        return returned

    def add(self, depth: DepthImage) -> list[LaserScan]:
        """Add a depth image of the robot's camera and return the scans that are ready."""
        self._first_ns = depth.stamp_ns if self._first_ns is None else self._first_ns
        self._waiting.append(depth)
        if depth.stamp_ns - self._first_ns < LIDAR_WAIT_S * 1e9:
            return []
        return self.flush()

    def flush(self) -> list[LaserScan]:
        """Return the scans of all waiting depth images; those that cannot be used are counted."""
        scans = [self._scan(depth) for depth in self._waiting]
        self._waiting.clear()
        return [scan for scan in scans if scan is not None]

    def check(self) -> None:
        """Raises MethodError: the log has no lidar, and no depth image could be used."""
        if self._has_lidar or self.counters["used.depth"] or not self.counters:
            return
        reasons = ", ".join(f"{n} x {name.rpartition('.')[2]}" for name, n in sorted(self.counters.items()))
        raise MethodError(
            f"the log has neither a scan nor a usable depth image of a camera on the robot ({reasons}): there are no ranges to "
            "localize by; give the camera a calibration and extrinsics on the robot's frame (log.extrinsics)"
        )

    def _scan(self, depth: DepthImage) -> LaserScan | None:
        name = depth.frame_id
        if name not in self._infos:
            self.counters["skipped.depth.no_calibration"] += 1
            return None
        if self._camera not in (None, name):
            self.counters["skipped.depth.second_camera"] += 1
            return None
        self._camera = name
        pinhole = Pinhole.of(self._infos[name], self._transforms[name])
        self.sensor_extrinsics[ranges_frame(name)] = planar_extrinsics(pinhole)
        scan = depth_scan(depth, pinhole, self._band)
        if np.isnan(scan.ranges_m).all():
            self.counters["skipped.depth.nothing_in_height_band"] += 1
            return None
        self.counters["used.depth"] += 1
        return scan
