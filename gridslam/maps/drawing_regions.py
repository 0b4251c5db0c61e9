"""Walls, free space and outside in a drawing of two colours. All lengths are pixels, arrays bool `(rows, cols)`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to

Mask = NDArray[np.bool_]

THIN = 3.0  # a colour whose widest spot is so much narrower than the other's is that of the strokes
SPECKLE_PX = 4  # smaller specks of either colour are noise of compression
WIDEST_LEAKS_PX = (
    0,
    1,
    2,
    3,
    4,
    6,
    8,
    11,
    15,
    20,
)  # half gaps through which the outside is kept from coming in
ENCLOSED_SHARE = 0.35  # of the strokes' surface must border on what is enclosed: less is but a loop of a pen
START_AROUND_PX = 3
CLOSING_DIRECTIONS = 8


@dataclass(frozen=True, slots=True)
class Regions:
    """Free space, surfaces, whether walls are the darker colour, and whether nothing encloses the free space."""

    free: Mask
    walls: Mask
    walls_are_dark: bool
    is_open: bool


def classes_of(levels: NDArray[np.uint8]) -> Mask:
    """Which pixels are dark, by Otsu's threshold; specks that compression leaves are taken out of either colour."""
    threshold, _ = cv2.threshold(
        cv2.medianBlur(np.ascontiguousarray(levels), 3), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU
    )
    if not levels.min() <= threshold < levels.max():  # the median has wiped out strokes of one pixel
        threshold, _ = cv2.threshold(
            np.ascontiguousarray(levels), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU
        )
    dark = levels <= threshold
    return _without_specks(~_without_specks(~dark))


def regions_of(
    dark: Mask, walls_are: Literal["auto", "dark", "bright"], gap_px: int, start: tuple[int, int] | None
) -> Regions | None:
    """Regions of a drawing; None when nothing is free. `start` is a (row, col) in free space."""
    walls_are_dark = _are_walls_dark(dark, start) if walls_are == "auto" else walls_are == "dark"
    strokes = dark if walls_are_dark else ~dark
    if not strokes.any() or strokes.all():
        return None
    barrier = _closed(strokes, gap_px)
    if start is not None:
        start = _nearest_free(barrier, start)
    outside = _outside(barrier, start)
    is_open = outside is None
    inside = ~barrier if outside is None else ~barrier & ~outside
    free = _component(inside, start)
    if not free.any():
        return None
    # Where the free space borders on the outside through a gap in the outline, a line is thought across.
    seam = _grown(inside, 1) & outside if outside is not None else np.zeros_like(free)
    return Regions(free & ~seam, (_grown(inside, 1) & barrier) | seam, walls_are_dark, is_open)


def _are_walls_dark(dark: Mask, start: tuple[int, int] | None) -> bool:
    """The colour of the walls: not that of the start; else the thin one; else the one at the picture's edge."""
    if start is not None:
        row, col = start
        r = START_AROUND_PX
        around = dark[max(row - r, 0) : row + r + 1, max(col - r, 0) : col + r + 1]
        return bool(around.mean() < 0.5)
    width_dark, width_bright = _widest(dark), _widest(~dark)
    if width_bright > THIN * width_dark:
        return True
    if width_dark > THIN * width_bright:
        return False
    edge = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    return bool(edge.mean() > 0.5)


def _widest(mask: Mask) -> float:
    """Radius of the largest disc in the mask."""
    return float(_distance(mask).max())


def _outside(barrier: Mask, start: tuple[int, int] | None) -> Mask | None:
    """What lies outside of the outline; None when nothing is enclosed.

    Gaps in the outline are kept shut by the least closing that encloses a place.
    """
    surface = barrier & _grown(~barrier, 1)
    to_wall = _distance(~barrier)
    widest = float(to_wall.max())
    for reach in WIDEST_LEAKS_PX:
        if reach > 0.7 * widest:
            break
        roomy = to_wall > reach if reach else ~barrier
        outside = _joined_to_edge(roomy)
        if reach:
            outside = _grown(outside, reach) & ~barrier
        inside = ~barrier & ~outside
        if (
            start is not None
            and inside[start]
            and bool((_component(inside, start) & (to_wall > reach)).any())
        ):
            return outside
        if start is None and (surface & _grown(inside, 1)).sum() > ENCLOSED_SHARE * surface.sum():
            return outside
    return None


def _joined_to_edge(mask: Mask) -> Mask:
    """The parts of a mask that touch the picture's edge."""
    labels = _labels(mask)
    edge = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    touching = np.zeros(int(labels.max()) + 1, np.bool_)
    touching[edge] = True
    touching[0] = False
    return np.asarray(touching[labels])


def _component(mask: Mask, start: tuple[int, int] | None) -> Mask:
    """The part of a mask that holds the start, or the largest one; empty where the mask is."""
    if not mask.any():
        return mask
    labels = _labels(mask)
    if start is not None and labels[start]:
        return np.asarray(labels == labels[start])
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return np.asarray(labels == int(sizes.argmax()))


def _nearest_free(barrier: Mask, start: tuple[int, int]) -> tuple[int, int]:
    """The free pixel nearest to a start that was put on a stroke by a hair."""
    if not barrier[start]:
        return start
    free = np.argwhere(~barrier)
    row, col = free[np.argmin(((free - start) ** 2).sum(axis=1))]
    return int(row), int(col)


def _closed(mask: Mask, gap_px: int) -> Mask:
    """A mask with gaps up to `gap_px` between strokes in line closed.

    Closing along lines, not with a disc, leaves corners and narrow passages as they are.
    """
    if gap_px < 1:
        return mask
    reach = gap_px + 2
    padded = np.pad(mask, reach).astype(np.uint8)
    closed = padded.copy()
    for angle in np.arange(CLOSING_DIRECTIONS) * (np.pi / CLOSING_DIRECTIONS):
        closed = np.maximum(
            closed,
            np.asarray(cv2.morphologyEx(padded, cv2.MORPH_CLOSE, _line_kernel(reach, angle)), np.uint8),
        )
    return np.asarray(closed[reach:-reach, reach:-reach] > 0)


def _line_kernel(length: int, angle_rad: float) -> NDArray[np.uint8]:
    """A line of so many pixels in a square kernel."""
    half = length // 2
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.uint8)
    along = np.rint(np.arange(-half, half + 1)[:, None] * (np.cos(angle_rad), np.sin(angle_rad))).astype(
        np.int64
    )
    kernel[half + along[:, 1], half + along[:, 0]] = 1
    return kernel


def _grown(mask: Mask, reach: int) -> Mask:
    """All pixels within `reach` of the mask (a disc; one pixel: its eight neighbours)."""
    if reach == 1:
        kernel = np.ones((3, 3), np.uint8)
        return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)
    return np.asarray(_distance(~mask) <= reach)


def _distance(mask: Mask) -> NDArray[np.float32]:
    """Distance of each pixel of the mask to the nearest one that is not."""
    if mask.all():
        return np.full(mask.shape, np.hypot(*mask.shape), np.float32)
    return distances_to(~mask)


def _labels(mask: Mask) -> NDArray[np.int32]:
    """Parts of a mask numbered from 1, joined by their sides."""
    return np.asarray(cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)[1], dtype=np.int32)


def _without_specks(mask: Mask) -> Mask:
    """The mask without parts of a few pixels."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    kept = np.asarray(stats[:, cv2.CC_STAT_AREA] > SPECKLE_PX)
    kept[0] = False
    return np.asarray(kept[labels]) if count > 1 else mask
