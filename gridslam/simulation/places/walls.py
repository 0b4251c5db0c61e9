"""Walls with bays: recessed doors, window niches and entrances at equal spacing, all alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gridslam.simulation.places.layout import XY, Array


@dataclass(frozen=True, slots=True)
class Bay:
    """A recess of `width_m` by `depth_m`, repeated every `pitch_m`."""

    pitch_m: float
    width_m: float
    depth_m: float


def bayed_wall(start: XY, end: XY, bay: Bay, margin_m: float = 0.5) -> Array:
    """Corners `(n, 2)` of a wall from `start` to `end` with bays recessed to its left, as many as fit, centred."""
    origin, span = np.asarray(start), np.subtract(end, start)
    length = float(np.hypot(*span))
    along = span / length
    left = np.array([-along[1], along[0]])
    count = max(int((length - 2.0 * margin_m - bay.width_m) / bay.pitch_m) + 1, 0)
    first = 0.5 * (length - (count - 1) * bay.pitch_m - bay.width_m)
    if first < margin_m:
        count = 0
    corners = [origin]
    for offset in first + bay.pitch_m * np.arange(count):
        before, after = origin + offset * along, origin + (offset + bay.width_m) * along
        corners += [before, before + bay.depth_m * left, after + bay.depth_m * left, after]
    return np.array([*corners, np.asarray(end)])


def bayed_polygon(corners: Array, bay: Bay) -> Array:
    """Corners `(n, 2)` of a closed polygon `(m, 2)` with bays added to every side.

    They reach into a counter-clockwise polygon, and out of a clockwise one.
    """
    following = np.roll(corners, -1, axis=0)
    sides = [
        bayed_wall((a[0], a[1]), (b[0], b[1]), bay)[:-1] for a, b in zip(corners, following, strict=True)
    ]
    return np.concatenate(sides)


def inset(corners: Array, distance_m: float) -> Array:
    """A convex counter-clockwise polygon `(n, 2)` with every side moved inwards (outwards where negative)."""
    sides = np.roll(corners, -1, axis=0) - corners
    along = sides / np.hypot(sides[:, 0], sides[:, 1])[:, None]
    moved = corners + distance_m * np.column_stack([-along[:, 1], along[:, 0]])
    found = []
    for i in range(len(corners)):
        matrix = np.column_stack([along[i - 1], -along[i]])
        t = np.linalg.solve(matrix, moved[i] - moved[i - 1])[0]
        found.append(moved[i - 1] + t * along[i - 1])
    return np.array(found)
