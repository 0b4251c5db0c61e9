"""What a rectified stereo head measures: disparities, and of them one for each bin of columns."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead
from gridslam.kernels.stereo_columns import MATCHED, NONE, STEPS_PER_PX, UNKNOWN, measure_columns

Floats = NDArray[np.float64]
Disparities = NDArray[np.float32]


__all__ = ["MATCHED", "NONE", "UNKNOWN", "ColumnSettings", "Columns", "Matcher", "measured_columns"]


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
