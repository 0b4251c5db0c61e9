"""Distortion of a lens: between the directions of points and where the lens shows them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import CameraInfo

Floats = NDArray[np.float64]

_FISHEYE = ("equidistant", "fisheye")
_MARGIN = 1.05  # points beyond the image's corner by this factor are shown nowhere


@dataclass(frozen=True, slots=True)
class Lens:
    """Distortion coefficients in OpenCV's order, of the plumb-bob and rational models or of a fisheye lens.

    Points are given by their direction: x and y over depth `(n, 2)`. `max_radius` is that of the image's corners, undistorted.
    """

    coefficients: Floats
    is_fisheye: bool
    max_radius: float

    @staticmethod
    def of(info: CameraInfo) -> Lens | None:
        """The lens of a calibration; None if it has no distortion."""
        if not np.isfinite(info.D).all() or not np.any(info.D):
            return None
        is_fisheye = info.distortion_model in _FISHEYE
        lens = Lens(np.asarray(info.D[:4] if is_fisheye else info.D, np.float64), is_fisheye, np.inf)
        K, right, low = info.K, info.width_px - 1, info.height_px - 1
        corners = np.array([(0, 0), (right, 0), (0, low), (right, low)], np.float64)
        shown = (corners - (K[0, 2], K[1, 2])) / (K[0, 0], K[1, 1])
        radius = float(np.hypot(*lens.undistorted(shown).T).max())
        return Lens(lens.coefficients, is_fisheye, _MARGIN * radius)

    def undistorted(self, shown: Floats) -> Floats:
        """Directions `(n, 2)` of the points that the lens shows at `(n, 2)`."""
        if not len(shown):
            return shown
        undistort = cv2.fisheye.undistortPoints if self.is_fisheye else cv2.undistortPoints
        points = undistort(np.ascontiguousarray(shown[:, None]), np.eye(3), self.coefficients)
        return np.asarray(points[:, 0], np.float64)

    def distorted(self, directions: Floats) -> Floats:
        """Image positions `(n, 2)` of points with these directions `(n, 2)`; NaN for those far outside of the image."""
        with np.errstate(invalid="ignore"):
            inside = np.flatnonzero(np.hypot(*directions.T) <= self.max_radius)
        shown = np.full_like(directions, np.nan)
        if len(inside):
            points = np.column_stack([directions[inside], np.ones(len(inside))])[:, None]
            project = cv2.fisheye.projectPoints if self.is_fisheye else cv2.projectPoints
            still = np.zeros(3)
            shown[inside] = project(points, still, still, np.eye(3), self.coefficients)[0].reshape(-1, 2)
        return shown
