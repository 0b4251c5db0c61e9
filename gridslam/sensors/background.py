"""What stands still before a fixed camera, and what does not: by colour, and by depth."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Depth = NDArray[np.float32]

_LIFT_SHARE = 0.1  # how quickly the depth background follows what is farther away than it
_SINK_SHARE = 0.002  # and what is nearer: furniture that stays


class ColourBackground:
    """Gaussian mixture per pixel (Zivkovic 2004, OpenCV's MOG2), cleaned by morphology (ispace-mcl, eqs. 5 - 7)."""

    def __init__(
        self, history: int, threshold: float, opening_px: int, closing_px: int, warm_up: int = 5
    ) -> None:
        self._history, self._threshold, self._warm_up = history, threshold, warm_up
        self._opening, self._closing = _disc(opening_px), _disc(closing_px)
        self.restart()

    def restart(self) -> None:
        """Forget everything, as after a light was switched on."""
        self._model = cv2.createBackgroundSubtractorMOG2(self._history, self._threshold, detectShadows=False)
        self.frames = 0

    def foreground(self, pixels: NDArray[np.uint8]) -> Mask:
        """Pixels `(rows, cols)` that are not background, of an image `(rows, cols)` or `(rows, cols, 3)`; learns from it.

        The first frames count alike; then the model forgets slowly, lest who stands for a while become background.
        """
        self.frames += 1
        rate = 1.0 / self.frames if self.frames <= self._warm_up else 1.0 / self._history
        mask = self._model.apply(np.ascontiguousarray(pixels), learningRate=rate)
        mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, self._opening)
        return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, self._closing)) > 0


class DepthBackground:
    """The largest depth that each pixel keeps coming back to: walls and floor behind what passes before them."""

    def __init__(self, margin_m: float, margin_share: float) -> None:
        self._margin_m, self._margin_share = margin_m, margin_share
        self.depth_m: Depth | None = None

    def learn(self, depth_m: Depth) -> None:
        """Take in a depth image `(rows, cols)`, NaN where there is none."""
        if self.depth_m is None:
            self.depth_m = depth_m.astype(np.float32)
            return
        known = self.depth_m
        off = depth_m - known
        rate = np.where(off > 0.0, np.float32(_LIFT_SHARE), np.float32(_SINK_SHARE))
        far = off > self._margin(known)  # what was seen first stood before it
        moved = np.where(far, depth_m, known + rate * off)
        self.depth_m = np.where(np.isnan(known), depth_m, np.where(np.isnan(off), known, moved))

    def nearer(self, depth_m: Depth) -> Mask:
        """Pixels with something before the background; none where the background is not known."""
        if self.depth_m is None:
            return np.zeros(depth_m.shape, np.bool_)
        with np.errstate(invalid="ignore"):
            return np.asarray(depth_m < self.depth_m - self._margin(depth_m))

    def off_share(self, depth_m: Depth, foreground: Mask) -> float:
        """Share of the pixels that are not what was learned: one looks through the background, or something stands before
        it that has the colour of background. Little, unless the camera was moved.
        """
        if self.depth_m is None:
            return 0.0
        off = depth_m - self.depth_m
        with np.errstate(invalid="ignore"):
            through = off > 3.0 * self._margin(self.depth_m)
            before = (off < -2.0 * self._margin(self.depth_m)) & ~foreground
        return float((through | before).sum() / max(np.isfinite(off).sum(), 1))

    def _margin(self, depth_m: Depth) -> Depth:
        return np.asarray(self._margin_m + self._margin_share * depth_m, np.float32)


def _disc(size_px: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(size_px, 1), max(size_px, 1))))
