"""Stereo visual odometry: features tracked between frames, placed by disparity, moved by PnP in RANSAC (stereo-bayes 1)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]
Disparities = NDArray[np.float32]

_WINDOW, _LEVELS = (21, 21), 4


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """Numbers of features, their spacing, and what counts as an inlier (px)."""

    features: int = 1200
    quality: float = 0.005
    spacing_px: int = 7
    inlier_px: float = 1.0
    least_inliers: int = 12
    least_disparity_px: float = 1.0


class VisualOdometry:
    """The motion of the robot over the ground between consecutive frames of a stereo head."""

    def __init__(self, head: StereoHead, settings: TrackingSettings | None = None) -> None:
        self._head = head
        self._settings = settings or TrackingSettings()
        self._left: Grey | None = None
        self._disparity: Disparities | None = None

    def step(self, left: Grey, disparity: Disparities) -> Floats | None:
        """T_before_now `(3,)` of the robot; None for the first frame, and where too little could be tracked."""
        before, places = self._left, self._disparity
        self._left, self._disparity = left, disparity
        if before is None or places is None or before.shape != left.shape:
            return None
        seen, points = self._features(before, places)
        if len(seen) < self._settings.least_inliers:
            return None
        there, kept = _tracked(before, left, seen)
        motion = self._motion(points[kept], there[kept])
        return None if motion is None else self._over_ground(*motion)

    def _features(self, left: Grey, disparity: Disparities) -> tuple[NDArray[np.float32], Floats]:
        """Corners `(n, 2)` (x, y) with a disparity, and their places `(n, 3)` in the optical frame."""
        s = self._settings
        corners = cv2.goodFeaturesToTrack(left, s.features, s.quality, s.spacing_px)
        if corners is None:
            return np.zeros((0, 2), np.float32), np.zeros((0, 3))
        seen = corners.reshape(-1, 2)
        cols, rows = np.rint(seen).astype(np.int64).T
        d = disparity[rows, cols].astype(np.float64)
        with np.errstate(invalid="ignore"):
            placed = d > s.least_disparity_px
        seen, d = seen[placed], d[placed]
        depth = self._head.focal_px * self._head.baseline_m / d
        x = (seen[:, 0] - self._head.centre_px[0]) / self._head.focal_px * depth
        y = (seen[:, 1] - self._head.centre_px[1]) / self._head.focal_px * depth
        return seen, np.stack([x, y, depth], axis=1)

    def _motion(self, points: Floats, seen: NDArray[np.float32]) -> tuple[Floats, Floats] | None:
        """Rotation `(3, 3)` and translation `(3,)` of the points from the former to the present optical frame."""
        s = self._settings
        if len(points) < s.least_inliers:
            return None
        f, (cx, cy) = self._head.focal_px, self._head.centre_px
        K = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
        cv2.setRNGSeed(0)
        pixels = seen.astype(np.float64)
        good, turn, shift, inliers = cv2.solvePnPRansac(
            points, pixels, K, None, iterationsCount=200, reprojectionError=s.inlier_px, confidence=0.999
        )
        if not good or inliers is None or len(inliers) < s.least_inliers:
            return None
        chosen = inliers.ravel()
        turn, shift = cv2.solvePnPRefineLM(points[chosen], pixels[chosen], K, None, turn, shift)
        return np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(shift.ravel(), np.float64)

    def _over_ground(self, rotation: Floats, translation: Floats) -> Floats:
        """T_before_now of the robot in the plane, from the motion of points between the optical frames."""
        mount = np.eye(4)
        mount[:3, :3], mount[:3, 3] = self._head.rotation, self._head.position
        now_before = np.eye(4)
        now_before[:3, :3], now_before[:3, 3] = rotation, translation
        moved = mount @ np.linalg.inv(now_before) @ np.linalg.inv(mount)
        return np.array([moved[0, 3], moved[1, 3], np.arctan2(moved[1, 0], moved[0, 0])])


def _tracked(
    before: Grey, now: Grey, seen: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where the corners `(n, 2)` are now, and which of them lead back to where they came from."""
    start = seen.reshape(-1, 1, 2)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before, now, start, start.copy(), winSize=_WINDOW, maxLevel=_LEVELS
    )
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(
        now, before, there, there.copy(), winSize=_WINDOW, maxLevel=_LEVELS
    )
    off = np.abs(back.reshape(-1, 2) - seen).max(axis=1)
    kept = (found.ravel() == 1) & (found_back.ravel() == 1) & (off < 0.5)
    return np.asarray(there.reshape(-1, 2), np.float32), np.asarray(kept)
