"""Walls, free space and outside of a two-coloured drawing. Lengths are pixels, arrays are bool `(rows, cols)`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.maps.drawings.drawing_light import in_even_light, is_light_uneven, strokes_in_even_light
from gridslam.maps.drawings.drawing_marks import Marks, marks_of

Mask = NDArray[np.bool_]

# A colour is that of the strokes if its widest area is narrower by this factor than the other's
THIN_RATIO = 3.0
SPECKLE_PX = 4  # largest size of specks of either colour, which are compression noise
# Half widths of gaps to the outside that are closed, tried in order.
LEAK_WIDTHS_PX = (0, 1, 2, 3, 4, 6, 8, 11, 15, 20)
# Fraction of the strokes' surface that borders on enclosed space; less is a small loop
MIN_ENCLOSED_RATIO = 0.35
START_RADIUS_PX = 3
CLOSING_DIRECTIONS = 8


@dataclass(frozen=True, slots=True)
class Regions:
    """Free space, wall surfaces, whether walls are the darker colour, and whether no outer wall encloses the free space.

    `enclosed` is all other space within walls, `marks` are the strokes that are no walls, `gaps_closed` is a number.
    """

    free: Mask
    walls: Mask
    walls_are_dark: bool
    is_open: bool
    enclosed: Mask
    marks: Marks
    gaps_closed: int


def classes_of(levels: NDArray[np.uint8], is_photograph: bool = False) -> tuple[Mask, bool]:
    """Mask `(rows, cols)` of the dark pixels, and whether the light was evened.

    The pixels are divided by Otsu's threshold, without specks of compression.     In a photograph with uneven light, dark means
    darker than the paper around.
    """
    dark = _darker_class(levels)
    is_uneven = is_light_uneven(levels, dark, is_photograph)
    if is_uneven:
        dark = strokes_in_even_light(in_even_light(levels))
    return _without_specks(~_without_specks(~dark)), is_uneven


def _darker_class(levels: NDArray[np.uint8]) -> Mask:
    threshold, _ = cv2.threshold(
        cv2.medianBlur(np.ascontiguousarray(levels), 3), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU
    )
    if not levels.min() <= threshold < levels.max():  # the median has removed strokes one pixel wide
        threshold, _ = cv2.threshold(
            np.ascontiguousarray(levels), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU
        )
    return np.asarray(levels <= threshold)


def regions_of(
    dark: Mask, walls_are: Literal["auto", "dark", "bright"], gap_px: int, start: tuple[int, int] | None
) -> Regions | None:
    """Regions of a drawing; None if nothing is free. `start` is a (row, col) in free space."""
    walls_are_dark = _are_walls_dark(dark, start) if walls_are == "auto" else walls_are == "dark"
    strokes = dark if walls_are_dark else ~dark
    if not strokes.any() or strokes.all():
        return None
    barrier = _closed(strokes, gap_px)
    marks = marks_of(strokes, barrier)
    if marks.ignored.any():
        strokes = strokes & ~marks.ignored
        barrier = _closed(strokes, gap_px)
    if start is not None:
        start = _nearest_free(barrier, start)
    outside = _outside(barrier, start)
    is_open = outside is None
    inside = ~barrier if outside is None else ~barrier & ~outside
    free = _component(inside, start)
    if not free.any():
        return None
    # Where the free space borders on the outside through a gap in the outer wall, a line closes the gap.
    seam = _grown(inside, 1) & outside if outside is not None else np.zeros_like(free)
    return Regions(
        free=free & ~seam,
        walls=(_grown(inside, 1) & barrier) | seam,
        walls_are_dark=walls_are_dark,
        is_open=is_open,
        enclosed=inside & ~free & ~seam,
        marks=marks,
        gaps_closed=_count_gaps(barrier & ~strokes, strokes) + _count_gaps(seam, barrier),
    )


def _count_gaps(added: Mask, strokes: Mask) -> int:
    """Number of added parts that join two strokes; others only fill notches."""
    count, labels = cv2.connectedComponents(added.astype(np.uint8), connectivity=8)
    grown = cv2.dilate(labels.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int64)
    contacts, contact_labels = cv2.connectedComponents(
        ((grown > 0) & strokes).astype(np.uint8), connectivity=8
    )
    touched = np.zeros(contacts, np.int64)
    touched[contact_labels.ravel()] = grown.ravel()
    return int((np.bincount(touched[1:], minlength=count)[1:] >= 2).sum())


def _are_walls_dark(dark: Mask, start: tuple[int, int] | None) -> bool:
    """Whether walls are dark: the colour that is not at the start, else the thin one, else the one at the picture's edge."""
    if start is not None:
        row, col = start
        r = START_RADIUS_PX
        around = dark[max(row - r, 0) : row + r + 1, max(col - r, 0) : col + r + 1]
        return bool(around.mean() < 0.5)
    width_dark, width_bright = _widest(dark), _widest(~dark)
    if width_bright > THIN_RATIO * width_dark:
        return True
    if width_dark > THIN_RATIO * width_bright:
        return False
    edge = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    return bool(edge.mean() > 0.5)


def _widest(mask: Mask) -> float:
    """Radius of the largest disc in the mask."""
    return float(_distance(mask).max())


def _outside(barrier: Mask, start: tuple[int, int] | None) -> Mask | None:
    """The outside of the outer walls; None if nothing is enclosed.

    Gaps in the outer walls are closed by the smallest closing that encloses a place.
    """
    surface = barrier & _grown(~barrier, 1)
    to_wall = _distance(~barrier)
    widest = float(to_wall.max())
    for radius in LEAK_WIDTHS_PX:
        if radius > 0.7 * widest:
            break
        beyond_leaks = to_wall > radius if radius else ~barrier
        outside = _joined_to_edge(beyond_leaks)
        if radius:
            outside = _grown(outside, radius) & ~barrier
        inside = ~barrier & ~outside
        if (
            start is not None
            and inside[start]
            and bool((_component(inside, start) & (to_wall > radius)).any())
        ):
            return outside
        if start is None and (surface & _grown(inside, 1)).sum() > MIN_ENCLOSED_RATIO * surface.sum():
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
    """The part of a mask that contains the start, or the largest one; empty if the mask is."""
    if not mask.any():
        return mask
    labels = _labels(mask)
    if start is not None and labels[start]:
        return np.asarray(labels == labels[start])
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return np.asarray(labels == int(sizes.argmax()))


def _nearest_free(barrier: Mask, start: tuple[int, int]) -> tuple[int, int]:
    """The free pixel nearest to a start that lies on a stroke."""
    if not barrier[start]:
        return start
    free = np.argwhere(~barrier)
    row, col = free[np.argmin(((free - start) ** 2).sum(axis=1))]
    return int(row), int(col)


def _closed(mask: Mask, gap_px: int) -> Mask:
    """The mask with gaps up to `gap_px` between collinear strokes closed.

    Closing along lines, not with a disc, leaves corners and narrow passages as they are.
    """
    if gap_px < 1:
        return mask
    radius = gap_px + 2
    padded = np.pad(mask, radius).astype(np.uint8)
    closed = padded.copy()
    for angle in np.arange(CLOSING_DIRECTIONS) * (np.pi / CLOSING_DIRECTIONS):
        closed = np.maximum(
            closed,
            np.asarray(cv2.morphologyEx(padded, cv2.MORPH_CLOSE, _line_kernel(radius, angle)), np.uint8),
        )
    return np.asarray(closed[radius:-radius, radius:-radius] > 0)


def _line_kernel(length: int, angle_rad: float) -> NDArray[np.uint8]:
    """A line of `length` pixels in a square kernel."""
    half = length // 2
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.uint8)
    along = np.rint(np.arange(-half, half + 1)[:, None] * (np.cos(angle_rad), np.sin(angle_rad))).astype(
        np.int64
    )
    kernel[half + along[:, 1], half + along[:, 0]] = 1
    return kernel


def _grown(mask: Mask, radius: int) -> Mask:
    """All pixels within `radius` of the mask (a disc; one pixel: its eight neighbours)."""
    if radius == 1:
        kernel = np.ones((3, 3), np.uint8)
        return np.asarray(cv2.dilate(mask.astype(np.uint8), kernel) > 0)
    return np.asarray(_distance(~mask) <= radius)


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
