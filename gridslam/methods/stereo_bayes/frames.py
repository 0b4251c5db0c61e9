"""From stereo messages to frames: the head's geometry, disparities, and the motion between frames."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead
from gridslam.core.messages import CameraInfo, Disparity, StereoPair, Transform
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.motion.visual_odometry import VisualOdometry
from gridslam.sensors.stereo_head import BLOCK_PX, StereoMatcher

Floats = NDArray[np.float64]

OPTICAL_FORWARD = (0.5, -0.5, 0.5, -0.5)  # orientation (w, x, y, z) of an optical frame that faces forward


@dataclass(frozen=True, slots=True)
class StereoFrame:
    """A disparity image `(rows, cols)` (px), its head, and T_last_this `(3,)` by visual odometry if requested."""

    stamp_ns: int
    disparity: NDArray[np.float32]
    head: StereoHead
    step: Floats | None


class FrameBuilder:
    """Collects calibrations and extrinsics, and turns pairs and disparity images into frames.

    Counters: used.stereo, used.disparity and skipped.<kind>.<reason>.
    """

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        self._matcher = StereoMatcher(config.advanced.disparity.matcher, config.disparity.disparities)
        self._left: dict[str, CameraInfo] = {}  # by frame
        self._right: dict[str, CameraInfo] = {}
        self._sensor_extrinsics: dict[str, Transform] = {}
        self._heads: dict[str, StereoHead] = {}
        self._odometry: dict[str, VisualOdometry] = {}
        self.counters: Counter[str] = Counter()

    def add_info(self, info: CameraInfo) -> None:
        """Add a calibration. That of the right camera is recognised by the baseline in its projection matrix."""
        side = self._right if info.P[0, 3] < 0.0 else self._left
        side.setdefault(info.frame_id, info)
        self.counters["used.camera_info"] += 1

    def add_extrinsics(self, extrinsics: Transform) -> None:
        """Add the pose of a camera in the base frame."""
        self._sensor_extrinsics[extrinsics.child_frame_id] = extrinsics

    def of_pair(self, pair: StereoPair, with_motion: bool) -> StereoFrame | None:
        """The frame of two images; None if they cannot be used."""
        head = self._head(pair.frame_id, "stereo")
        if head is None:
            return None
        if pair.left.shape != pair.right.shape or min(pair.left.shape) < BLOCK_PX:
            self.counters["skipped.stereo.size"] += 1
            return None
        if pair.left.shape[1] <= self._config.disparity.disparities:
            self.counters["skipped.stereo.narrower_than_disparities"] += 1
            return None
        disparity = self._matcher.disparity(pair.left, pair.right)
        step = None
        if with_motion:
            odometry = self._odometry.setdefault(pair.frame_id, VisualOdometry(head))
            step = odometry.step(np.ascontiguousarray(pair.left), disparity)
        self.counters["used.stereo"] += 1
        return StereoFrame(pair.stamp_ns, disparity, head, step)

    def of_disparity(self, image: Disparity) -> StereoFrame | None:
        """The frame of a disparity image; without calibration its centre serves as the principal point."""
        if not (image.focal_px > 0.0 and image.baseline_m > 0.0):
            self.counters["skipped.disparity.no_calibration"] += 1
            return None
        if image.frame_id not in self._heads:
            rows, cols = image.disparity_px.shape
            info = self._left.get(image.frame_id)
            centre = (0.5 * (cols - 1), 0.5 * (rows - 1))
            if info is not None:
                centre = (float(info.P[0, 2]), float(info.P[1, 2]))
            self._add_head(image.frame_id, image.focal_px, centre, image.baseline_m)
        self.counters["used.disparity"] += 1
        return StereoFrame(image.stamp_ns, image.disparity_px, self._heads[image.frame_id], None)

    def _head(self, frame: str, kind: str) -> StereoHead | None:
        if frame in self._heads:
            return self._heads[frame]
        left = self._left.get(frame) or (next(iter(self._left.values())) if len(self._left) == 1 else None)
        right = self._right.get(frame) or (
            next(iter(self._right.values())) if len(self._right) == 1 else None
        )
        if left is None or right is None or not right.P[0, 0] > 0.0:
            self.counters[f"skipped.{kind}.no_calibration"] += 1
            return None
        P = left.P
        baseline = float((P[0, 3] - right.P[0, 3]) / right.P[0, 0])
        self._add_head(frame, float(P[0, 0]), (float(P[0, 2]), float(P[1, 2])), baseline)
        return self._heads[frame]

    def _add_head(
        self, frame: str, focal_px: float, centre_px: tuple[float, float], baseline_m: float
    ) -> None:
        extrinsics = self._sensor_extrinsics.get(frame)
        quat = OPTICAL_FORWARD if extrinsics is None else extrinsics.quat_wxyz
        position = (0.0, 0.0, 0.0) if extrinsics is None else extrinsics.translation_m
        head = StereoHead.mounted(focal_px, centre_px, baseline_m, quat, position)
        if not head.looks_along_the_ground:
            # The frame was defined as x forward, y left, z up although its images are optical: assume that it faces forward.
            self.counters["stereo.frame_is_not_optical"] += 1
            head = StereoHead.mounted(focal_px, centre_px, baseline_m, OPTICAL_FORWARD, position)
        self._heads[frame] = head
