"""Disparity images of a rectified stereo head, and the nearest (or most frequent) obstacle in each bin of their columns."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead
from gridslam.core.messages import readonly
from gridslam.kernels.stereo.stereo_columns import (
    MATCHED,
    NONE,
    STEPS_PER_PX,
    UNKNOWN,
    BinCriteria,
    HeightBand,
    measure_columns,
)

Floats = NDArray[np.float64]
Disparities = NDArray[np.float32]

__all__ = [
    "MATCHED",
    "NONE",
    "UNKNOWN",
    "ColumnSettings",
    "StereoColumns",
    "StereoMatcher",
    "measured_columns",
]

MIN_EXTENT_ROWS = 2.0  # smallest height of an obstacle in the image
BLOCK_PX = 5  # side of the matched block
UNIQUENESS_PERCENT = 10  # margin over the second best match
SPECKLE_PX = 100  # regions of similar disparity with fewer pixels are removed
SPECKLE_RANGE = 2  # largest difference between neighbouring pixels of such a region, in OpenCV's units
MAX_LEFT_RIGHT_PX = 1  # largest difference between the disparities of the left and the right image
P1_FACTOR, P2_FACTOR = 8, 32  # smoothness penalties of SGBM, as OpenCV recommends
DISPARITY_STEPS = 16.0  # steps per pixel in OpenCV's disparity images


@dataclass(frozen=True, slots=True)
class ColumnSettings:
    """Settings for finding the obstacle in each bin of columns.

    bin_px: Number of columns in a bin.
    low_m, high_m: Heights above the floor between which points can belong to an obstacle.
    min_height_m: Smallest height of an obstacle.
    min_matched_ratio: Fraction of matched pixels below which a bin is UNKNOWN.
    take_nearest: Whether the nearest obstacle is taken, or else that with the most pixels.
    max_disparity_px: Largest disparity.
    """

    bin_px: int
    low_m: float
    high_m: float
    min_height_m: float
    min_matched_ratio: float
    take_nearest: bool
    max_disparity_px: float


@dataclass(frozen=True, slots=True)
class StereoColumns:
    """One measurement per bin.

    `bearings` `(m,)` (rad) are those of the bins' middles in the robot's frame, `disparities_px` `(m,)` those of the obstacles,
    NaN without one. `status` `(m,)` is MATCHED, NONE (no obstacle) or UNKNOWN.
    """

    bearings: Floats
    disparities_px: Floats
    status: NDArray[np.uint8]


def measured_columns(disparity: Disparities, head: StereoHead, settings: ColumnSettings) -> StereoColumns:
    """The obstacle in every bin of columns of a disparity image `(rows, cols)` (px)."""
    rows, cols = disparity.shape
    steps = int(settings.max_disparity_px * STEPS_PER_PX) + 1
    step_px = np.arange(steps) / STEPS_PER_PX
    min_rows = np.maximum(settings.min_height_m * step_px / head.baseline_m, MIN_EXTENT_ROWS)
    band = HeightBand(
        slope=head.slope(rows, cols),
        focal_baseline=head.focal_px * head.baseline_m,
        camera_m=float(head.position[2]),
        low_m=settings.low_m,
        high_m=settings.high_m,
    )
    criteria = BinCriteria(
        bin_px=settings.bin_px,
        max_px=settings.max_disparity_px,
        min_extent_px=min_rows * settings.bin_px,
        min_matched_ratio=settings.min_matched_ratio,
        take_nearest=settings.take_nearest,
    )
    found, status = measure_columns(readonly(disparity, np.float32), band, criteria)
    middle_columns: Floats = (np.arange(len(found), dtype=np.float64) + 0.5) * settings.bin_px - 0.5
    return StereoColumns(head.bearings(middle_columns), found, status)


class StereoMatcher:
    """OpenCV's semi-global matching (`kind` "sgbm") or block matching ("bm") for disparities below `disparities` px.

    OpenCV requires `disparities` to be a multiple of 16.
    """

    def __init__(self, kind: str, disparities: int) -> None:
        if kind == "bm":
            matcher = cv2.StereoBM.create(disparities, BLOCK_PX)
            matcher.setUniquenessRatio(UNIQUENESS_PERCENT)
            matcher.setSpeckleWindowSize(SPECKLE_PX)
            matcher.setSpeckleRange(SPECKLE_RANGE)
            self._matcher: cv2.StereoMatcher = matcher
        else:
            self._matcher = cv2.StereoSGBM.create(
                minDisparity=0,
                numDisparities=disparities,
                blockSize=BLOCK_PX,
                P1=P1_FACTOR * BLOCK_PX**2,
                P2=P2_FACTOR * BLOCK_PX**2,
                disp12MaxDiff=MAX_LEFT_RIGHT_PX,
                uniquenessRatio=UNIQUENESS_PERCENT,
                speckleWindowSize=SPECKLE_PX,
                speckleRange=SPECKLE_RANGE,
                mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
            )

    def disparity(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Disparities:
        """Disparities `(rows, cols)` (px) of the left image, NaN without a match; both images are grey and rectified."""
        fixed = self._matcher.compute(np.ascontiguousarray(left), np.ascontiguousarray(right))
        return np.where(fixed > 0, fixed.astype(np.float32) / DISPARITY_STEPS, np.float32(np.nan))
