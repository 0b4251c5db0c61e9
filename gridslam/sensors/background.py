"""Background models of a fixed RGB-D camera: one of colours and one of depths."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Depth = NDArray[np.float32]

_RATE_FARTHER = 0.1  # learning rate of the depth background where a reading lies behind it
# And where it lies before it: slow, so that people do not become background but new furniture does
_RATE_NEARER = 0.002


class ColourBackground:
    """Gaussian mixture per pixel (Zivkovic 2004, OpenCV's MOG2), cleaned by morphology (ispace-mcl, eqs. 5 - 7).

    `history` is the number of frames that the model remembers, `threshold` the squared Mahalanobis distance from which a colour
    is foreground. Opening removes smaller specks than `opening_px`, closing fills smaller holes than `closing_px`.
    """

    def __init__(
        self, history: int, threshold: float, *, opening_px: int, closing_px: int, warm_up: int = 5
    ) -> None:
        self._history, self._threshold, self._warm_up = history, threshold, warm_up
        self._opening, self._closing = _disc(opening_px), _disc(closing_px)
        self.restart()

    def restart(self) -> None:
        """Discard the model, as after a light was switched on."""
        self._model = cv2.createBackgroundSubtractorMOG2(self._history, self._threshold, detectShadows=False)
        self.frames = 0

    def foreground(self, pixels: NDArray[np.uint8]) -> Mask:
        """Mask `(rows, cols)` of the foreground in an image `(rows, cols)` or `(rows, cols, 3)`; the model learns from the image.

        The first `warm_up` frames have equal weights. After them the model adapts slowly, so that a person who stands for a
        while does not become background.
        """
        self.frames += 1
        rate = 1.0 / self.frames if self.frames <= self._warm_up else 1.0 / self._history
        return self.cleaned(self._model.apply(np.ascontiguousarray(pixels), learningRate=rate) > 0)

    def cleaned(self, mask: Mask) -> Mask:
        """The mask `(rows, cols)` without small specks and holes."""
        opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, self._opening)
        return np.asarray(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, self._closing)) > 0


class DepthBackground:
    """The depth of walls and floor at each pixel: the largest depth that the pixel returns to.

    A reading differs from the background when it is off by more than `margin_m` plus `margin_ratio` of the depth.
    """

    def __init__(self, margin_m: float, margin_ratio: float) -> None:
        self._margin_m, self._margin_ratio = margin_m, margin_ratio
        self.depth_m: Depth | None = None

    def learn(self, depth_m: Depth) -> None:
        """Update the background by a depth image `(rows, cols)`, NaN where there is no reading."""
        if self.depth_m is None:
            self.depth_m = depth_m.astype(np.float32)
            return
        known = self.depth_m
        off = depth_m - known
        rate = np.where(off > 0.0, np.float32(_RATE_FARTHER), np.float32(_RATE_NEARER))
        # Where the background was an object, what lies behind it replaces it at once.
        is_behind = off > self._margin(known)
        moved = np.where(is_behind, depth_m, known + rate * off)
        self.depth_m = np.where(np.isnan(known), depth_m, np.where(np.isnan(off), known, moved))

    def nearer(self, depth_m: Depth) -> Mask:
        """Mask `(rows, cols)` of the depths before the background; False where the background is unknown."""
        if self.depth_m is None:
            return np.zeros(depth_m.shape, np.bool_)
        with np.errstate(invalid="ignore"):
            return np.asarray(depth_m < self.depth_m - self._margin(depth_m))

    def _margin(self, depth_m: Depth) -> Depth:
        return np.asarray(self._margin_m + self._margin_ratio * depth_m, np.float32)


def _disc(size_px: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(size_px, 1), max(size_px, 1))))
