"""Long straight surfaces about a place: what a door hinges in, and what explains beams without any object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ANGLES = 90
BAND_M = 0.06
FINAL_BAND_M = 0.008
MOST_POINTS = 1500
COVER_CELL_M = 0.1
LEAST_POINTS = 3  # of a piece of that length that counts as seen


@dataclass(frozen=True, slots=True)
class Walls:
    """Lines n . p = offset: unit normals `(k, 2)`, offsets `(k,)`, and the seen extent along them `(k, 2)`."""

    normals: Floats
    offsets: Floats
    extents: Floats

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def directions(self) -> Floats:
        """Angles of the lines `(k,)` in [0, pi)."""
        return np.asarray(np.mod(np.arctan2(self.normals[:, 1], self.normals[:, 0]) + np.pi / 2, np.pi))

    def signed_distances(self, points: Floats) -> Floats:
        """Signed distances `(m, k)` (m) of points `(m, 2)` from the lines; infinite beyond a line's extent."""
        along = points @ np.stack([-self.normals[:, 1], self.normals[:, 0]])
        distance = points @ self.normals.T - self.offsets
        inside = (along > self.extents[:, 0] - BAND_M) & (along < self.extents[:, 1] + BAND_M)
        return np.asarray(np.where(inside, distance, np.inf))

    def distances(self, points: Floats) -> Floats:
        """Distance `(m,)` (m) of points `(m, 2)` from the nearest line; infinite where there is none."""
        if not len(self):
            return np.full(len(points), np.inf)
        return np.asarray(np.abs(self.signed_distances(points)).min(axis=1))


def find_walls(points: Floats, least_length_m: float, most: int = 6) -> Walls:
    """The longest straight surfaces through points `(m, 2)`, one after the other, each at least that long where it was seen.

    Found in a Hough accumulator, then fitted by least squares that more and more trusts the nearest points only: what stands
    2 cm before the wall (a closed door) does not bend it.
    """
    if len(points) > MOST_POINTS:
        points = points[(np.arange(MOST_POINTS) * len(points)) // MOST_POINTS]
    left = points
    found: list[tuple[float, ...]] = []
    for _ in range(2 * most):
        if len(left) < 20 or len(found) == most:
            break
        normal, offset = _fit(left, *_strongest(left))
        near = np.abs(left @ normal - offset) < BAND_M
        along = left[near] @ np.array([-normal[1], normal[0]])
        if not near.any():
            break
        cells, counts = np.unique(np.floor(along / COVER_CELL_M), return_counts=True)
        seen = cells[counts >= LEAST_POINTS]
        if len(seen) * COVER_CELL_M >= least_length_m:
            low, high = float(seen[0]), float(seen[-1] + 1.0)
            found.append((*map(float, normal), offset, COVER_CELL_M * low, COVER_CELL_M * high))
        left = left[~near]
    lines = np.array(found).reshape(-1, 5)
    return Walls(lines[:, :2], lines[:, 2], lines[:, 3:])


def _strongest(points: Floats) -> tuple[Floats, float]:
    angles = np.pi * np.arange(ANGLES) / ANGLES
    normals = np.stack([np.cos(angles), np.sin(angles)])
    offsets = points @ normals
    low = float(offsets.min())
    bins = ((offsets - low) / BAND_M).astype(np.int64)
    count = int(bins.max()) + 1
    votes = np.bincount((bins + count * np.arange(ANGLES)).ravel(), minlength=count * ANGLES)
    best = int(np.argmax(votes))
    angle, cell = best // count, best % count
    return normals[:, angle], low + (cell + 0.5) * BAND_M


def _fit(points: Floats, normal: Floats, offset: float) -> tuple[Floats, float]:
    """Least squares over pieces of the line, each by the median of its points, so that a piece seen often counts no more.

    The Geman-McClure weight, its scale going from the band to its final value, leaves the majority of the pieces.
    """
    for _ in range(2):
        error = points @ normal - offset
        near = np.abs(error) < BAND_M
        if np.count_nonzero(near) < 3:
            break
        along = np.array([-normal[1], normal[0]])
        pieces = _medians(points[near] @ along, error[near])
        normal, offset = _through(pieces, normal, along, offset)
    return normal, offset


def _medians(along: Floats, error: Floats) -> Floats:
    """For each piece (10 cm) of a line the mean place along it, and the median distance from it `(k, 2)`."""
    cell = np.floor(along / COVER_CELL_M).astype(np.int64)
    order = np.lexsort((error, cell))
    cell, along, error = cell[order], along[order], error[order]
    first = np.flatnonzero(np.r_[True, cell[1:] != cell[:-1]])
    count = np.diff(np.r_[first, len(cell)])
    middle = 0.5 * (error[first + (count - 1) // 2] + error[first + count // 2])
    return np.column_stack([np.add.reduceat(along, first) / count, middle])


def _through(pieces: Floats, normal: Floats, along: Floats, offset: float) -> tuple[Floats, float]:
    """The line through pieces `(k, 2)` given along and across another line."""
    scale = BAND_M
    line: Floats = np.zeros(2)
    design = np.column_stack([np.ones(len(pieces)), pieces[:, 0] - pieces[:, 0].mean()])
    for _ in range(10):
        weight = (scale**2 / (scale**2 + (pieces[:, 1] - design @ line) ** 2)) ** 2
        normal_matrix = design.T @ (design * weight[:, None]) + 1e-9 * np.eye(2)
        line = np.asarray(np.linalg.solve(normal_matrix, design.T @ (weight * pieces[:, 1])))
        scale = max(0.7 * scale, FINAL_BAND_M)
    turned = normal - line[1] * along
    turned = turned / np.hypot(*turned)
    point = normal * (offset + line[0]) + along * pieces[:, 0].mean()
    return turned, float(turned @ point)
