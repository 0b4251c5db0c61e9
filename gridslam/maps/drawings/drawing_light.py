"""Photographs of drawings: recognises uneven light, such as a shadow, and divides the picture by the brightness of the paper."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Levels = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# Fraction of the contrast of the two colours; a border with less is one of light, not of a stroke
WEAK_RATIO = 0.2
MAX_WEAK_BORDERS = 0.3  # fraction of such borders above which the light is uneven
MAX_WEAK_BORDERS_PHOTOGRAPH = 0.05
BORDER_PX = 5
SMALL_PX = 240  # longer side of the reduced picture in which the paper is estimated
PAPER_PX = 41  # window there; strokes cover less than half of it, so that its median is the paper
PAPER_LEVEL = 128.0  # level of the paper in the result
SMOOTHING_PX = 1.0
STROKE_PX = 15  # wider than strokes
MIN_NOISE = 0.5  # standard deviation of the paper, levels
NOISE_SIGMAS = 5.0  # a pixel that differs by more is no noise
FAINT_SIGMAS = 3.0
CLEAR_RATIO, FAINT_RATIO = 0.5, 0.3  # fractions of the contrast of strokes at which they are clear and faint


def is_light_uneven(levels: Levels, dark: Mask, is_photograph: bool) -> bool:
    """Whether many borders of the `dark` pixels (all arrays `(rows, cols)`) have far less contrast than the two classes."""
    border = (cv2.dilate(dark.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~dark
    if not border.any() or dark.all():
        return False
    smooth = cv2.GaussianBlur(levels, (0, 0), 1.0)
    window = np.ones((BORDER_PX, BORDER_PX), np.uint8)
    contrast = cv2.subtract(cv2.dilate(smooth, window), cv2.erode(smooth, window))
    between = float(levels[~dark].mean()) - float(levels[dark].mean())
    weak = float((contrast[border] < WEAK_RATIO * between).mean())
    return bool(weak > (MAX_WEAK_BORDERS_PHOTOGRAPH if is_photograph else MAX_WEAK_BORDERS))


def in_even_light(levels: Levels) -> Levels:
    """The picture relative to the local brightness of its paper, which becomes `PAPER_LEVEL`."""
    rows, cols = levels.shape
    scale = min(1.0, SMALL_PX / max(rows, cols))
    size = (max(round(cols * scale), 1), max(round(rows * scale), 1))
    small = cv2.resize(levels, size, interpolation=cv2.INTER_AREA)
    paper = cv2.GaussianBlur(cv2.medianBlur(small, PAPER_PX), (0, 0), PAPER_PX / 12)
    paper = cv2.resize(paper.astype(np.float32), (cols, rows), interpolation=cv2.INTER_LINEAR)
    relative = PAPER_LEVEL * levels.astype(np.float32) / np.maximum(paper, 1.0)
    return np.asarray(np.clip(np.rint(relative), 0, 255).astype(np.uint8))


def strokes_in_even_light(levels: Levels) -> Mask:
    """Mask `(rows, cols)` of the dark pixels of a picture whose paper is `PAPER_LEVEL`.

    Strokes stand out from the noise of the paper; each is followed from where it is clear to where it is faint. Where the
    strokes are bright, all other pixels are dark.
    """
    smooth = cv2.GaussianBlur(levels, (0, 0), SMOOTHING_PX).astype(np.float32)
    difference = PAPER_LEVEL - smooth
    noise = max(1.4826 * float(np.median(np.abs(difference - np.median(difference)))), MIN_NOISE)
    are_dark = _are_strokes_dark(smooth)
    strokes = _followed(difference if are_dark else -difference, noise)
    return strokes if are_dark else ~strokes


def _are_strokes_dark(smooth: NDArray[np.float32]) -> bool:
    """Whether narrow dark structures stand out more than narrow bright ones, whatever the light around them is."""
    window = np.ones((STROKE_PX, STROKE_PX), np.uint8)
    dark = cv2.morphologyEx(smooth, cv2.MORPH_BLACKHAT, window)
    bright = cv2.morphologyEx(smooth, cv2.MORPH_TOPHAT, window)
    return float(np.percentile(dark, 99.0)) >= float(np.percentile(bright, 99.0))


def _followed(difference: NDArray[np.float32], noise: float) -> Mask:
    """Pixels of strokes by hysteresis: all that are joined to a clear one by faint ones."""
    candidates = difference[difference > NOISE_SIGMAS * noise]
    if not candidates.size:
        return np.zeros(difference.shape, np.bool_)
    contrast = float(np.percentile(candidates, 75.0))
    faint = difference > max(FAINT_RATIO * contrast, FAINT_SIGMAS * noise)
    clear = difference > max(CLEAR_RATIO * contrast, NOISE_SIGMAS * noise)
    labels = np.asarray(cv2.connectedComponents(faint.astype(np.uint8), connectivity=8)[1])
    kept = np.zeros(int(labels.max()) + 1, np.bool_)
    kept[labels[clear]] = True
    kept[0] = False
    return np.asarray(kept[labels])
