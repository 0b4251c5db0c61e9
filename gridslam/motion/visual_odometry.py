"""Stereo visual odometry: features tracked between frames, 3-D points by disparity, motion by PnP in RANSAC (stereo-bayes 1)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]
Disparities = NDArray[np.float32]

TRACKING_WINDOW_PX, PYRAMID_LEVELS = (21, 21), 4
MAX_ROUND_TRIP_PX = 0.5  # largest distance between a corner and itself tracked forward and back
RANSAC_ITERATIONS, RANSAC_CONFIDENCE = 200, 0.999


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Number, quality and spacing of the features, largest reprojection error of an inlier (px), and minima."""

    features: int = 1200
    quality: float = 0.005
    spacing_px: int = 7
    inlier_px: float = 1.0
    min_inliers: int = 12
    min_disparity_px: float = 1.0


class VisualOdometry:
    """Motion of the robot over the ground between consecutive frames of a stereo head."""

    def __init__(self, head: StereoHead, settings: TrackingSettings | None = None) -> None:
        self._head = head
        self._settings = settings or TrackingSettings()
        self._left: Grey | None = None
        self._disparity: Disparities | None = None

    def step(self, left: Grey, disparity: Disparities) -> Floats | None:
        """T_last_now `(3,)` of the robot; None for the first frame, or if too few features could be tracked."""
        last, last_disparity = self._left, self._disparity
        self._left, self._disparity = left, disparity
        if last is None or last_disparity is None or last.shape != left.shape:
            return None
        corners, points = self._features(last, last_disparity)
        if len(corners) < self._settings.min_inliers:
            return None
        pixels, kept = _tracked(last, left, corners)
        motion = self._motion(points[kept], pixels[kept])
        return None if motion is None else self._over_ground(*motion)

    def _features(self, left: Grey, disparity: Disparities) -> tuple[NDArray[np.float32], Floats]:
        """Corners `(n, 2)` (x, y) (px) with a disparity, and their points `(n, 3)` (m) in the optical frame."""
        s = self._settings
        found = cv2.goodFeaturesToTrack(left, s.features, s.quality, s.spacing_px)
        if found is None:
            return np.zeros((0, 2), np.float32), np.zeros((0, 3))
        corners = found.reshape(-1, 2)
        cols, rows = np.rint(corners).astype(np.int64).T
        d = disparity[rows, cols].astype(np.float64)
        with np.errstate(invalid="ignore"):
            has_disparity = d > s.min_disparity_px
        corners, d = corners[has_disparity], d[has_disparity]
        depth = self._head.focal_px * self._head.baseline_m / d
        x = (corners[:, 0] - self._head.centre_px[0]) / self._head.focal_px * depth
        y = (corners[:, 1] - self._head.centre_px[1]) / self._head.focal_px * depth
        return corners, np.stack([x, y, depth], axis=1)

    def _motion(self, points: Floats, corners: NDArray[np.float32]) -> tuple[Floats, Floats] | None:
        """Rotation `(3, 3)` and translation `(3,)` of the points `(n, 3)` from the last to the present optical frame."""
        s = self._settings
        if len(points) < s.min_inliers:
            return None
        f, (cx, cy) = self._head.focal_px, self._head.centre_px
        K = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
        cv2.setRNGSeed(0)
        pixels = corners.astype(np.float64)
        is_found, rotation, shift, inliers = cv2.solvePnPRansac(
            points,
            pixels,
            K,
            None,
            iterationsCount=RANSAC_ITERATIONS,
            reprojectionError=s.inlier_px,
            confidence=RANSAC_CONFIDENCE,
        )
        if not is_found or inliers is None or len(inliers) < s.min_inliers:
            return None
        chosen = inliers.ravel()
        rotation, shift = cv2.solvePnPRefineLM(points[chosen], pixels[chosen], K, None, rotation, shift)
        return np.asarray(cv2.Rodrigues(rotation)[0], np.float64), np.asarray(shift.ravel(), np.float64)

    def _over_ground(self, rotation: Floats, translation: Floats) -> Floats:
        """T_last_now `(3,)` of the robot in the plane, from the motion of points between the optical frames."""
        T_base_optical = np.eye(4)
        T_base_optical[:3, :3], T_base_optical[:3, 3] = self._head.rotation, self._head.position
        now_last = np.eye(4)
        now_last[:3, :3], now_last[:3, 3] = rotation, translation
        motion = T_base_optical @ np.linalg.inv(now_last) @ np.linalg.inv(T_base_optical)
        return np.array([motion[0, 3], motion[1, 3], np.arctan2(motion[1, 0], motion[0, 0])])


def _tracked(
    last: Grey, now: Grey, corners: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The corners `(n, 2)` in the present image, and a mask of those that track back to their old position."""
    start = corners.reshape(-1, 1, 2)
    tracked, found, _ = cv2.calcOpticalFlowPyrLK(
        last, now, start, start.copy(), winSize=TRACKING_WINDOW_PX, maxLevel=PYRAMID_LEVELS
    )
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(
        now, last, tracked, tracked.copy(), winSize=TRACKING_WINDOW_PX, maxLevel=PYRAMID_LEVELS
    )
    round_trip = np.abs(back.reshape(-1, 2) - corners).max(axis=1)
    kept = (found.ravel() == 1) & (found_back.ravel() == 1) & (round_trip < MAX_ROUND_TRIP_PX)
    return np.asarray(tracked.reshape(-1, 2), np.float32), np.asarray(kept)
