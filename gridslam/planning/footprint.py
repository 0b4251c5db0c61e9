"""The robot's footprint on the floor, as discs that cover it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError

Floats = NDArray[np.float64]

RELATIVE_PITCH = 0.05  # spacing of the samples, as a fraction of the footprint's smaller extent
MAX_SAMPLES = 120  # samples along the larger extent
HALF_DIAGONAL = 0.71  # half diagonal of a square cell, rounded up
MAX_CORNERS = 100
MAX_CORNER_M = 1e3


def disc(radius_m: float) -> Floats:
    """The footprint `(1, 3)` of a round robot: x, y, radius. Raises ConfigError if the radius is not positive."""
    if not (np.isfinite(radius_m) and radius_m > 0.0):
        raise ConfigError(f"robot radius {radius_m:g}: expected a positive number of metres")
    return np.array([[0.0, 0.0, radius_m]])


def cover_polygon(corners: Floats) -> Floats:
    """Discs `(n, 3)` (x, y, radius; m, robot frame) that together cover a convex polygon `(m, 2)`.

    They extend beyond it by at most about a tenth of its smaller extent. A pose that is free for the discs is free for the
    polygon. The greedy cover repeatedly takes the disc that covers the most uncovered samples. Raises ConfigError if the corners
    (m, robot frame) are not a convex polygon around the origin.
    """
    corners = _counter_clockwise(corners)
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = high - low
    pitch = max(RELATIVE_PITCH * float(extent.min()), float(extent.max()) / MAX_SAMPLES)
    axes = [np.arange(lo + 0.5 * pitch, hi + 0.5 * pitch, pitch) for lo, hi in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    points = points[_inset(corners, points) > -HALF_DIAGONAL * pitch]  # cells that the polygon may touch
    radii = np.maximum(_inset(corners, points), 0.0) + pitch
    distances = np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0))
    covers = distances + HALF_DIAGONAL * pitch <= radii[:, None]
    uncovered = np.ones(len(points), dtype=bool)
    chosen = []
    while uncovered.any():
        best = int(np.argmax((covers & uncovered).sum(axis=1)))
        chosen.append(best)
        uncovered &= ~covers[best]
    return np.column_stack([points[chosen], radii[chosen]])


def _counter_clockwise(corners: Floats) -> Floats:
    """The corners `(m, 2)` in counter-clockwise order. Raises ConfigError if they are not a convex polygon around the origin."""
    corners = np.asarray(corners, dtype=np.float64)
    is_valid = (
        corners.ndim == 2 and 3 <= len(corners) <= MAX_CORNERS and (np.abs(corners) <= MAX_CORNER_M).all()
    )
    if not is_valid:
        raise ConfigError(
            f"footprint: expected 3 to {MAX_CORNERS} corners x,y in metres, within {MAX_CORNER_M:g} m"
        )
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    cross_products = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    if (cross_products < 0.0).all():
        return _counter_clockwise(corners[::-1])
    if not (cross_products > 0.0).all() or float(_inset(corners, np.zeros((1, 2)))[0]) <= 0.0:
        raise ConfigError(
            "footprint: expected a convex polygon, corner by corner, with the robot's origin inside"
        )
    return corners


def _inset(corners: Floats, points: Floats) -> Floats:
    """Distance (m) of points inside a counter-clockwise convex polygon to its boundary; negative outside."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1) / np.hypot(*edges.T)[:, None]
    return np.asarray(((points[:, None] - corners[None]) * normals[None]).sum(axis=-1).min(axis=1))
