"""Lines, dots and areas with smooth edges on RGB pictures `(rows, cols, 3)`, uint8; coordinates are pixels, not rounded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

Colour: TypeAlias = tuple[int, int, int]
Pixels: TypeAlias = NDArray[np.float64]  # (n, 2): x to the right, y down
Canvas: TypeAlias = NDArray[np.uint8]

FREE: Colour = (255, 255, 255)
WALL: Colour = (28, 32, 40)
UNKNOWN: Colour = (214, 218, 224)
PATH: Colour = (30, 110, 200)
UNTRUSTED: Colour = (235, 130, 20)
LOOP: Colour = (150, 60, 180)
BAND: Colour = (120, 170, 230)
START: Colour = (30, 150, 70)
END: Colour = (205, 45, 45)
POINTS: Colour = (205, 45, 45)
PARTICLES: Colour = (235, 130, 20)
AXIS_X: Colour = (200, 40, 40)
AXIS_Y: Colour = (40, 150, 60)
INK: Colour = (60, 66, 76)
PAPER: Colour = (255, 255, 255)

SHIFT = 4  # coordinates are rounded to 1/16 of a pixel
MAX_PX = 30_000.0  # farther points are moved to here; OpenCV's coordinates are 32-bit integers


def line(canvas: Canvas, points: Pixels, colour: Colour, width_px: float) -> None:
    """Draw a polyline."""
    if len(points) > 1:
        width = max(round(width_px), 1)
        cv2.polylines(canvas, [_fixed(points)], False, colour, width, cv2.LINE_AA, SHIFT)


def dots(canvas: Canvas, points: Pixels, colour: Colour, radius_px: float) -> None:
    """Draw a filled circle at each point."""
    radius = round(radius_px * 2**SHIFT)
    for x, y in _fixed(points).tolist():
        cv2.circle(canvas, (x, y), radius, colour, cv2.FILLED, cv2.LINE_AA, SHIFT)


def circles(canvas: Canvas, points: Pixels, colour: Colour, radii_px: Sequence[float]) -> None:
    """Draw filled circles of different radii."""
    for (x, y), radius in zip(_fixed(points).tolist(), radii_px, strict=True):
        size = round(min(radius, MAX_PX) * 2**SHIFT)
        cv2.circle(canvas, (x, y), size, colour, cv2.FILLED, cv2.LINE_AA, SHIFT)


def polygon(canvas: Canvas, corners: Pixels, colour: Colour) -> None:
    """Fill a polygon."""
    cv2.fillPoly(canvas, [_fixed(corners)], colour, cv2.LINE_AA, SHIFT)


def translucent(canvas: Canvas, opacity: float, draw: Callable[[Canvas], None]) -> None:
    """Let `draw` paint, and blend what it paints with the canvas."""
    painted = canvas.copy()
    draw(painted)
    cv2.addWeighted(painted, opacity, canvas, 1.0 - opacity, 0.0, dst=canvas)


def _fixed(points: Pixels) -> NDArray[np.int32]:
    """Points as fixed-point numbers: OpenCV's coordinates are those of pixel centres."""
    near = np.clip(np.nan_to_num(points), -MAX_PX, MAX_PX)
    return np.asarray(np.rint((near - 0.5) * 2**SHIFT).astype(np.int32))
