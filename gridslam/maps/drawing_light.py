"""Photographs of drawings: recognises uneven light, such as a shadow, and divides the picture by the brightness of the paper."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Levels = NDArray[np.uint8]
Mask = NDArray[np.bool_]

WEAK_RATIO = 0.2  # of the contrast of the two colours; a border with less is one of light, not of a stroke
MAX_WEAK_BORDERS = 0.3  # fraction of such borders above which the light is uneven
BORDER_PX = 5
SMALL_PX = 240  # longer side of the reduced picture in which the paper is estimated
PAPER_PX = 61  # window there; strokes cover less than half of it, so that its median is the paper
PAPER_LEVEL = 128.0  # of the paper in the result


def is_light_uneven(levels: Levels, dark: Mask) -> bool:
    """Whether many borders between dark and bright pixels have far less contrast than the two classes."""
    border = (cv2.dilate(dark.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~dark
    if not border.any() or dark.all():
        return False
    smooth = cv2.GaussianBlur(levels, (0, 0), 1.0)
    window = np.ones((BORDER_PX, BORDER_PX), np.uint8)
    contrast = cv2.subtract(cv2.dilate(smooth, window), cv2.erode(smooth, window))
    between = float(levels[~dark].mean()) - float(levels[dark].mean())
    return bool((contrast[border] < WEAK_RATIO * between).mean() > MAX_WEAK_BORDERS)


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
