"""The robot's outline on the floor, as discs that cover it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError

Floats = NDArray[np.float64]

FINENESS = 0.05  # of the outline's smaller extent: the raster's pitch and how far discs stand out of it
MOST_SAMPLES = 120  # along the larger extent
MOST_CORNERS = 100
FARTHEST_M = 1e3


def disc(radius_m: float) -> Floats:
    """The footprint `(1, 3)` of a round robot: x, y, radius."""
    if not (np.isfinite(radius_m) and radius_m > 0.0):
        raise ConfigError(f"robot radius {radius_m:g}: expected a positive number of metres")
    return np.array([[0.0, 0.0, radius_m]])


def cover_polygon(corners: Floats) -> Floats:
    """Discs `(n, 3)` (x, y, radius; m, robot frame) that together cover a convex polygon `(m, 2)`.

    They stand out by about a tenth of its smaller extent at most: what is free for them is free for the polygon.
    Each in turn is the one that covers most of what is still bare. Raises ConfigError: not a convex polygon about the origin.
    """
    corners = _counter_clockwise(corners)
    low, high = corners.min(axis=0), corners.max(axis=0)
    extent = high - low
    pitch = max(FINENESS * float(extent.min()), float(extent.max()) / MOST_SAMPLES)
    axes = [np.arange(lo + 0.5 * pitch, hi + 0.5 * pitch, pitch) for lo, hi in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    points = points[
        _inset(corners, points) > -0.71 * pitch
    ]  # every square of the raster that the polygon may touch
    radii = np.maximum(_inset(corners, points), 0.0) + pitch
    apart = np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0))
    covers = apart + 0.71 * pitch <= radii[:, None]
    bare = np.ones(len(points), dtype=bool)
    chosen = []
    while bare.any():
        best = int(np.argmax((covers & bare).sum(axis=1)))
        chosen.append(best)
        bare &= ~covers[best]
    return np.column_stack([points[chosen], radii[chosen]])


def _counter_clockwise(corners: Floats) -> Floats:
    corners = np.asarray(corners, dtype=np.float64)
    is_sound = (
        corners.ndim == 2 and 3 <= len(corners) <= MOST_CORNERS and (np.abs(corners) <= FARTHEST_M).all()
    )
    if not is_sound:
        raise ConfigError(
            f"footprint: expected 3 to {MOST_CORNERS} corners x,y in metres, within {FARTHEST_M:g} m"
        )
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    bends = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    if (bends < 0.0).all():
        return _counter_clockwise(corners[::-1])
    if not (bends > 0.0).all() or float(_inset(corners, np.zeros((1, 2)))[0]) <= 0.0:
        raise ConfigError(
            "footprint: expected a convex outline, corner by corner, with the robot's origin inside"
        )
    return corners


def _inset(corners: Floats, points: Floats) -> Floats:
    """How far inside a counter-clockwise convex polygon points lie (m); negative outside."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1) / np.hypot(*edges.T)[:, None]
    return np.asarray(((points[:, None] - corners[None]) * normals[None]).sum(axis=-1).min(axis=1))
