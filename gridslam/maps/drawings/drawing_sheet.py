"""A sheet of paper on a table: its edge is found as a quadrilateral, and the perspective is undone.

Points are `(x, y)` in pixels from the upper left corner, x to the right and y down; arrays have the top row first.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

SEARCH_SIDE_PX = 400  # longer side of the reduced picture in which the sheet is searched
CLOSED_PX = 9  # strokes and text up to this width there belong to the paper
MIN_AREA = 0.15  # smallest area of the sheet, as a fraction of the picture
MAX_AREA = 0.97
MIN_OVERLAP = 0.95  # intersection over union of the bright area and its quadrilateral
MAX_BRIGHT_AROUND = 0.15  # fraction of what surrounds the quadrilateral that is as bright as the paper
MAX_OUTSIDE = 0.05  # largest distance of a corner outside of the picture, as a fraction of its side
EVEN_LIMITS = (0.03, 0.04, 0.055, 0.075, 0.1)  # limits of the change of log light per pixel
EVEN_AREAS = 3  # tried at each limit
EVEN_RIM_PX = 2
TOLERANCES = np.arange(0.015, 0.09, 0.01)  # tolerances for the corners, as fractions of the contour's length
# Width of the rim that the paper next to it replaces, as a fraction of the sheet's shorter side
EDGE_RATIO = 0.012
MIN_CONVERGENCE = 0.05  # convergence of opposite sides from which the proportions follow from the perspective
MIN_FOCAL, MAX_FOCAL = 0.6, 3.0  # focal lengths of cameras, in longer sides of the picture
NEAR_PX, FAR_PX = 3.0, 9.0  # distances from a side at which the brightness is compared
SHARP_RATIO = 0.6  # fraction of the drop over the far distance that happens over the near one
MIN_STEP = 8.0  # levels
MIN_INK, MAX_INK = 0.002, 0.4  # fraction of the sheet that is drawn on


def find_sheet(colours: Bytes) -> Floats | None:
    """Corners `(4, 2)` of a sheet from its upper left corner clockwise; None if there is none.

    The sheet is a quadrilateral, brighter than all that surrounds it, in a picture `(rows, cols)` or `(rows, cols, 3)`.
    """
    rows, cols = colours.shape[:2]
    scale = min(1.0, SEARCH_SIDE_PX / max(rows, cols))
    size = (max(round(cols * scale), 1), max(round(rows * scale), 1))
    small = cv2.resize(colours, size, interpolation=cv2.INTER_AREA)
    # A table of wood is bright, but not in all of its channels.
    darkest = small if small.ndim == 2 else small.min(axis=2)
    levels = np.asarray(cv2.GaussianBlur(darkest, (0, 0), 1.0), np.uint8)
    best = _best_sheet(levels, _bright_areas(levels))
    if best is None:  # the paper in a shadow may be darker than the table beside it
        best = _best_sheet(levels, _even_areas(levels))
    if best is None:
        return None
    return _from_upper_left(np.asarray((best + 0.5) * (cols / size[0], rows / size[1]) - 0.5))


def _best_sheet(levels: Bytes, areas: Iterator[NDArray[np.uint8]]) -> Floats | None:
    """The corners of the area that is a quadrilateral most clearly, and a sheet."""
    best, best_overlap = None, MIN_OVERLAP
    for area in areas:
        found = _quadrilateral(area)
        if (
            found is not None
            and found[1] > best_overlap
            and _has_sharp_edges(levels, found[0])
            and _has_ink(levels, found[0])
        ):
            best, best_overlap = found
    return best


def flattened(pixels: Bytes, corners: Floats) -> Bytes:
    """The sheet seen from above, with its true proportions; its rim is replaced by the paper next to it.

    `pixels` are `(rows, cols)` or `(rows, cols, 3)`; `corners` `(4, 2)` are the sheet's corners (x, y) in them.
    """
    width, height = _size_of(corners, pixels.shape[:2])
    target = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32) - np.float32(0.5)
    warp = cv2.getPerspectiveTransform(corners.astype(np.float32), target)
    flat = cv2.warpPerspective(
        pixels, warp, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    rim = max(2, round(EDGE_RATIO * min(width, height)))
    inner = np.ascontiguousarray(flat[rim:-rim, rim:-rim])
    return np.asarray(cv2.copyMakeBorder(inner, rim, rim, rim, rim, cv2.BORDER_REPLICATE))


def _bright_areas(levels: Bytes) -> Iterator[NDArray[np.uint8]]:
    """The largest bright areas at several thresholds, with strokes and holes filled."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSED_PX, CLOSED_PX))
    low, high = np.percentile(levels, [3.0, 97.0])
    otsu, _ = cv2.threshold(levels, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    for threshold in (otsu, *np.linspace(low, high, 14)[1:-1]):
        opened = cv2.morphologyEx(
            (levels > threshold).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)
        )
        # Outside of the picture nothing is bright.
        padded = np.pad(opened, CLOSED_PX)
        closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)[CLOSED_PX:-CLOSED_PX, CLOSED_PX:-CLOSED_PX]
        contours, _ = cv2.findContours(np.ascontiguousarray(closed), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        if not contours:
            continue
        largest = max(contours, key=cv2.contourArea)
        filled = np.zeros_like(levels)
        cv2.drawContours(filled, [largest], -1, 1, cv2.FILLED)
        around = closed & (cv2.dilate(filled, np.ones((9, 9), np.uint8)) == 0)
        if around.sum() <= MAX_BRIGHT_AROUND * max(int((filled == 0).sum()), 1):
            yield filled


def _even_areas(levels: Bytes) -> Iterator[NDArray[np.uint8]]:
    """The largest areas within which the light changes gradually only, for several limits, with strokes and holes filled."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSED_PX, CLOSED_PX))
    paper = cv2.morphologyEx(levels, cv2.MORPH_CLOSE, kernel).astype(np.float32)
    light = np.log(paper + 4.0)
    change = np.hypot(
        cv2.Sobel(light, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(light, cv2.CV_32F, 0, 1, scale=0.125)
    )
    for limit in EVEN_LIMITS:
        contours, _ = cv2.findContours(
            (change < limit).astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
        )
        for contour in sorted(contours, key=cv2.contourArea, reverse=True)[:EVEN_AREAS]:
            filled = np.zeros_like(levels)
            cv2.drawContours(filled, [contour], -1, 1, cv2.FILLED)
            # The edge is where the change is largest, beyond the border of the even area.
            yield np.asarray(cv2.dilate(filled, np.ones((3, 3), np.uint8), iterations=EVEN_RIM_PX), np.uint8)


def _quadrilateral(area: NDArray[np.uint8]) -> tuple[Floats, float] | None:
    """Corners of the quadrilateral that covers a filled area best, and how much they overlap."""
    rows, cols = area.shape
    if not MIN_AREA <= area.mean() <= MAX_AREA:
        return None
    contour = cv2.findContours(area, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0][0]
    hull = cv2.convexHull(contour)
    length = cv2.arcLength(hull, True)
    for tolerance in TOLERANCES:
        polygon = cv2.approxPolyDP(hull, float(tolerance * length), True).reshape(-1, 2)
        if len(polygon) <= 4:
            break
    if len(polygon) != 4:
        return None
    corners = _with_fitted_sides(polygon.astype(np.float64), contour.reshape(-1, 2).astype(np.float64))
    slack = MAX_OUTSIDE * max(rows, cols)
    if corners is None or (corners < -slack).any() or (corners > np.array([cols, rows]) + slack).any():
        return None
    covered = np.zeros_like(area)
    cv2.fillConvexPoly(covered, np.rint(corners * 16).astype(np.int32), 1, shift=4)
    return corners, float((covered & area).sum() / max(int((covered | area).sum()), 1))


def _with_fitted_sides(polygon: Floats, contour: Floats) -> Floats | None:
    """Corners where lines fitted to the contour along each side meet."""
    lines = []
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        along = end - start
        length = float(np.hypot(*along))
        if length < CLOSED_PX:
            return None
        unit = along / length
        offsets = contour - start
        position, distance = offsets @ unit, np.abs(offsets @ np.array([-unit[1], unit[0]]))
        near = (position > 0.1 * length) & (position < 0.9 * length) & (distance < 0.04 * length + 2.0)
        if near.sum() < CLOSED_PX:
            return None
        vx, vy, x, y = cv2.fitLine(contour[near].astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).ravel()
        lines.append(np.cross((x, y, 1.0), (x + vx, y + vy, 1.0)))
    meetings = np.array([np.cross(lines[k - 1], lines[k]) for k in range(4)], np.float64)
    if (np.abs(meetings[:, 2]) < 1e-9).any():
        return None
    corners = meetings[:, :2] / meetings[:, 2:]
    return corners if cv2.isContourConvex(corners.astype(np.float32)) else None


def _has_sharp_edges(levels: Bytes, corners: Floats) -> bool:
    """Whether the brightness drops at once across the sides; the border of a shadow is gradual.

    One side may lie at the picture's border.
    """
    rows, cols = levels.shape
    sharp = 0
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (end - start) / np.hypot(*(end - start))
        outwards = np.array([along[1], -along[0]]) * (1.0 if _is_clockwise(corners) else -1.0)
        middle = start + np.linspace(0.1, 0.9, 60)[:, None] * (end - start)
        values = []
        for distance in (NEAR_PX, -NEAR_PX, FAR_PX, -FAR_PX):
            x, y = np.rint(middle + distance * outwards).astype(np.int64).T
            inside = (x >= 0) & (y >= 0) & (x < cols) & (y < rows)
            values.append(np.where(inside, levels[y.clip(0, rows - 1), x.clip(0, cols - 1)], np.nan))
        near, far = values[1] - values[0], values[3] - values[2]
        valid = np.isfinite(near + far)
        if valid.mean() < 0.5:
            continue
        if np.median(near[valid]) < max(SHARP_RATIO * float(np.median(far[valid])), MIN_STEP):
            return False
        sharp += 1
    return sharp >= 3


def _is_clockwise(corners: Floats) -> bool:
    x, y = corners.T
    return bool((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0.0)


def _has_ink(levels: Bytes, corners: Floats) -> bool:
    """Whether there are strokes on the sheet, away from its rim."""
    inside = np.zeros_like(levels)
    shrunk = corners.mean(axis=0) + 0.92 * (corners - corners.mean(axis=0))
    cv2.fillConvexPoly(inside, np.rint(shrunk).astype(np.int32), 1)
    paper = cv2.medianBlur(levels, 31).astype(np.float32)
    ink = (levels < 0.93 * paper)[inside > 0]
    return bool(ink.size and MIN_INK < ink.mean() < MAX_INK)


def _from_upper_left(corners: Floats) -> Floats:
    """The corners clockwise as seen, the upper left one first."""
    centre = corners.mean(axis=0)
    angles = np.arctan2(corners[:, 1] - centre[1], corners[:, 0] - centre[0])
    ordered = corners[np.argsort(angles)]
    return np.asarray(np.roll(ordered, -int(ordered.sum(axis=1).argmin()), axis=0))


def _size_of(corners: Floats, picture: tuple[int, int]) -> tuple[int, int]:
    """Width and height in pixels of the flattened sheet."""
    sides = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    width, height = float(max(sides[0], sides[2])), float(max(sides[1], sides[3]))
    ratio = _proportions(corners, picture)
    if ratio is not None and 0.5 < ratio * height / width < 2.0:
        width, height = (width, width / ratio) if width > ratio * height else (ratio * height, height)
    shrink = min(1.0, 2.0 * max(picture) / max(width, height))
    return max(round(width * shrink), 16), max(round(height * shrink), 16)


def _proportions(corners: Floats, picture: tuple[int, int]) -> float | None:
    """Width over height of the sheet, by a camera whose axis passes through the picture's middle (Zhang and He 2007).

    None if the perspective is too weak to say.
    """
    rows, cols = picture
    centre = np.array([cols / 2, rows / 2])
    m1, m2, m4, m3 = (np.array([*(corner - centre), 1.0]) for corner in corners)  # m1 m2 above, m3 m4 below
    k2 = np.dot(np.cross(m1, m4), m3) / np.dot(np.cross(m2, m4), m3)
    k3 = np.dot(np.cross(m1, m4), m2) / np.dot(np.cross(m3, m4), m2)
    n2, n3 = k2 * m2 - m1, k3 * m3 - m1
    if min(abs(k2 - 1.0), abs(k3 - 1.0)) < MIN_CONVERGENCE:
        return None
    focal_squared = -(n2[0] * n3[0] + n2[1] * n3[1]) / (n2[2] * n3[2])
    if not (MIN_FOCAL * max(picture)) ** 2 < focal_squared < (MAX_FOCAL * max(picture)) ** 2:
        return None
    lengths = [(n[0] ** 2 + n[1] ** 2) / focal_squared + n[2] ** 2 for n in (n2, n3)]
    return float(np.sqrt(lengths[0] / lengths[1]))
