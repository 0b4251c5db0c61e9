"""A rectified stereo head on the robot: its geometry, its disparities, and one measurement for each bin of columns."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.stereo_columns import MATCHED, NONE, STEPS_PER_PX, UNKNOWN, measure_columns
from gridslam.sensors.fixed_camera import rotation_matrix

Floats = NDArray[np.float64]
Disparities = NDArray[np.float32]

__all__ = [
    "MATCHED",
    "NONE",
    "UNKNOWN",
    "ColumnSettings",
    "Columns",
    "Matcher",
    "StereoHead",
    "measured_columns",
]


@dataclass(frozen=True, slots=True)
class StereoHead:
    """The left camera: focal length and centre in pixels, baseline, and T_base_optical as rotation `(3, 3)` and position `(3,)`.

    The optical frame has x to the right, y down and z along the view; d = f B / z (1.2).
    """

    focal_px: float
    centre_px: tuple[float, float]
    baseline_m: float
    rotation: Floats
    position: Floats

    @staticmethod
    def mounted(
        focal_px: float,
        centre_px: tuple[float, float],
        baseline_m: float,
        quat_wxyz: tuple[float, float, float, float],
        position: tuple[float, float, float],
    ) -> StereoHead:
        """With the rotation as a quaternion."""
        rotation = rotation_matrix(quat_wxyz)
        return StereoHead(focal_px, centre_px, baseline_m, rotation, np.array(position))

    @property
    def looks_along_the_ground(self) -> bool:
        """Whether the optical axis is closer to the ground than to the vertical, with the image upright."""
        return bool(abs(self.rotation[2, 2]) < 0.7 and self.rotation[2, 1] < -0.7)

    def slope(self, rows: int, cols: int) -> NDArray[np.float32]:
        """How much higher `(rows, cols)` than the camera the point of each pixel is, per metre of depth."""
        x = (np.arange(cols) - self.centre_px[0]) / self.focal_px
        y = (np.arange(rows) - self.centre_px[1]) / self.focal_px
        up = self.rotation[2]
        return np.asarray(up[0] * x[None] + up[1] * y[:, None] + up[2], np.float32)

    def bearings(self, columns: Floats) -> Floats:
        """Directions `(m,)` over the ground, in the robot's frame, of the horizontal rays through columns."""
        x = (columns - self.centre_px[0]) / self.focal_px
        up = self.rotation[2]
        y = -(up[0] * x + up[2]) / up[1]
        rays = np.stack([x, y, np.ones_like(x)], axis=1) @ self.rotation.T
        return np.asarray(np.arctan2(rays[:, 1], rays[:, 0]))

    def depths(self, bearings: Floats, ranges_m: Floats, height_m: float) -> Floats:
        """Depth along the optical axis `(m, n)` of points at ground ranges `(n,)` from the camera and a height."""
        ahead = self.rotation[:2, 2]
        along = np.cos(bearings) * ahead[0] + np.sin(bearings) * ahead[1]
        above = (height_m - self.position[2]) * self.rotation[2, 2]
        return np.asarray(along[:, None] * ranges_m[None] + above)


@dataclass(frozen=True, slots=True)
class ColumnSettings:
    """How columns are read; see the method's config."""

    bin_px: int
    low_m: float
    high_m: float
    least_height_m: float
    least_share: float
    take_nearest: bool
    most_px: float


@dataclass(frozen=True, slots=True)
class Columns:
    """One measurement per bin: directions in the robot's frame `(m,)`, disparities `(m,)`, and status `(m,)`."""

    bearings: Floats
    disparities_px: Floats
    status: NDArray[np.uint8]


def measured_columns(disparity: Disparities, head: StereoHead, settings: ColumnSettings) -> Columns:
    """The first obstacle of every bin of columns."""
    rows, cols = disparity.shape
    steps = int(settings.most_px * STEPS_PER_PX) + 1
    d = np.arange(steps) / STEPS_PER_PX
    extent = np.maximum(settings.least_height_m * d / head.baseline_m, 2.0) * settings.bin_px
    found, status = measure_columns(
        np.ascontiguousarray(disparity, np.float32),
        head.slope(rows, cols),
        head.focal_px * head.baseline_m,
        float(head.position[2]),
        settings.low_m,
        settings.high_m,
        settings.bin_px,
        settings.most_px,
        extent,
        settings.least_share,
        settings.take_nearest,
    )
    middles: Floats = (np.arange(len(found), dtype=np.float64) + 0.5) * settings.bin_px - 0.5
    return Columns(head.bearings(middles), found, status)


class Matcher:
    """Disparities by OpenCV: semi-global (SGBM) or block matching (BM)."""

    def __init__(self, kind: str, disparities: int, block_px: int, uniqueness: int, speckle_px: int) -> None:
        if kind == "bm":
            matcher = cv2.StereoBM.create(disparities, max(block_px, 5))
            matcher.setUniquenessRatio(uniqueness)
            matcher.setSpeckleWindowSize(speckle_px)
            matcher.setSpeckleRange(2)
            self._matcher: cv2.StereoMatcher = matcher
        else:
            self._matcher = cv2.StereoSGBM.create(
                minDisparity=0,
                numDisparities=disparities,
                blockSize=block_px,
                P1=8 * block_px**2,
                P2=32 * block_px**2,
                disp12MaxDiff=1,
                uniquenessRatio=uniqueness,
                speckleWindowSize=speckle_px,
                speckleRange=2,
                mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
            )

    def disparity(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Disparities:
        """Disparity image `(rows, cols)` of the left one, NaN where there is no match."""
        fixed = self._matcher.compute(np.ascontiguousarray(left), np.ascontiguousarray(right))
        return np.where(fixed > 0, fixed.astype(np.float32) / 16.0, np.float32(np.nan))
