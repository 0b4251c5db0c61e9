"""From stereo messages to frames: the head's geometry, disparities, and the motion between frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import OPTICAL_FORWARD, StereoHead, side_of
from gridslam.core.messages import CameraInfo, Disparity, StereoPair, Transform
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.motion.visual_odometry import VisualOdometry
from gridslam.sensors.stereo_head import BLOCK_PX, StereoMatcher
from gridslam.sensors.stereo_rig import StereoRig, stereo_rig

Floats = NDArray[np.float64]


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
        self._rigs: dict[str, StereoRig] = {}
        self._odometry: dict[str, VisualOdometry] = {}
        self.counters: Counter[str] = Counter()

    def add_info(self, info: CameraInfo) -> None:
        """Add a calibration. The right camera is recognised by its name or frame, or else by the baseline in P."""
        named = side_of((info.camera, info.frame_id))
        is_right = named == "right" if named else info.P[0, 3] < 0.0
        side = self._right if is_right else self._left
        side.setdefault(info.frame_id, info)
        self.counters["used.camera_info"] += 1

    def add_extrinsics(self, extrinsics: Transform) -> None:
        """Add the pose of a camera in the base frame."""
        self._sensor_extrinsics[extrinsics.child_frame_id] = extrinsics

    def of_pair(self, pair: StereoPair, with_motion: bool) -> StereoFrame | None:
        """The frame of two images; None, and a count, if they cannot be used. `with_motion` adds visual odometry."""
        rig = self._rig(pair)
        if rig is None:
            return None
        if pair.left.shape != pair.right.shape or min(pair.left.shape) < BLOCK_PX:
            self.counters["skipped.stereo.size"] += 1
            return None
        if pair.left.shape[1] <= self._config.disparity.disparities:
            self.counters["skipped.stereo.narrower_than_disparities"] += 1
            return None
        head = self._heads[pair.frame_id]
        left, right = rig.rectified(pair)
        disparity = self._matcher.disparity(left, right)
        step = None
        if with_motion:
            odometry = self._odometry.setdefault(pair.frame_id, VisualOdometry(head))
            step = odometry.step(np.ascontiguousarray(left), disparity)
        self.counters["used.stereo"] += 1
        return StereoFrame(pair.stamp_ns, disparity, head, step)

    def of_disparity(self, image: Disparity) -> StereoFrame | None:
        """The frame of a disparity image; without camera_info, the principal point is assumed at the centre of the image.

        None, and a count, without focal length and baseline.
        """
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

    @property
    def notes(self) -> list[str]:
        """Repairs of calibrations and pictures, and doubts about them, one line each."""
        return [note for rig in self._rigs.values() for note in rig.notes]

    @property
    def is_rectified_here(self) -> bool:
        """Whether any pictures were raw and had to be rectified."""
        return any(rig.maps is not None for rig in self._rigs.values())

    @property
    def row_offsets_px(self) -> dict[str, float]:
        """Measured row offset between the pictures of each head, by frame."""
        measured = {frame: rig.row_offset_px for frame, rig in self._rigs.items()}
        return {frame: round(offset, 2) for frame, offset in measured.items() if offset is not None}

    def _rig(self, pair: StereoPair) -> StereoRig | None:
        """The rig of a pair; None, and a count, if the log has no calibration of both cameras."""
        frame = pair.frame_id
        if frame in self._rigs:
            return self._rigs[frame]
        left = self._left.get(frame) or _only(self._left)
        right = self._right.get(frame) or _only(self._right)
        if left is None or right is None:
            self.counters["skipped.stereo.no_calibration"] += 1
            return None
        rig = self._rigs[frame] = stereo_rig(pair, left, right)
        c = rig.calibration
        self._add_head(frame, c.focal_px, c.centre_px, c.baseline_m)
        return rig

    def _add_head(
        self, frame: str, focal_px: float, centre_px: tuple[float, float], baseline_m: float
    ) -> None:
        extrinsics = self._sensor_extrinsics.get(frame)
        quat = OPTICAL_FORWARD if extrinsics is None else extrinsics.quat_wxyz
        position = (0.0, 0.0, 0.0) if extrinsics is None else extrinsics.translation_m
        head = StereoHead.of_extrinsics(focal_px, centre_px, baseline_m, quat, position)
        if not head.looks_along_the_ground:
            # The frame was defined as x forward, y left, z up although its images are optical: assume that it faces forward.
            self.counters["stereo.frame_is_not_optical"] += 1
            head = StereoHead.of_extrinsics(focal_px, centre_px, baseline_m, OPTICAL_FORWARD, position)
        self._heads[frame] = head


def _only(infos: Mapping[str, CameraInfo]) -> CameraInfo | None:
    """The only calibration of a side; None if there are several or none."""
    return next(iter(infos.values())) if len(infos) == 1 else None
