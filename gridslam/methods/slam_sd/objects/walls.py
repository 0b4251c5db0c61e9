"""Long straight surfaces around a place: doors hinge in them, and they explain beams without any object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import evenly_spaced

Floats = NDArray[np.float64]

ANGLES = 90  # number of angles of the Hough accumulator: 2 degrees
BAND_M = 0.06  # points this close to a line belong to it
FINAL_BAND_M = 0.008  # final scale of the robust fit: range noise
MAX_POINTS = 1500
MAX_WALLS = 6
MIN_REMAINING_POINTS = 20  # with fewer points no further wall is searched for
PIECE_M = 0.1  # a wall is covered by pieces of this length
MIN_POINTS_PER_PIECE = 3  # smallest number of points of a piece that counts as seen
FIT_ROUNDS = 2
FIT_ITERATIONS = 10
SCALE_FACTOR = 0.7  # factor by which the robust scale shrinks per iteration
REGULARISATION = 1e-9  # keeps the fit of a single piece solvable


@dataclass(frozen=True, slots=True)
class Walls:
    """Lines n . p = offset: unit normals `(k, 2)`, offsets `(k,)` (m), and the observed extents along them `(k, 2)` (m)."""

    normals: Floats
    offsets: Floats
    extents: Floats

    def __len__(self) -> int:
        return len(self.offsets)

    @property
    def directions(self) -> Floats:
        """Directions of the lines `(k,)` in [0, pi)."""
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


def find_walls(points: Floats, min_length_m: float) -> Walls:
    """At most `MAX_WALLS` straight surfaces through points `(m, 2)`, each observed over at least `min_length_m`.

    Lines are found in a Hough accumulator, then fitted by robust least squares: a closed door 2 cm in front of the wall
    does not tilt the line.
    """
    remaining = points = points[evenly_spaced(len(points), MAX_POINTS)]
    found: list[tuple[float, ...]] = []
    for _ in range(2 * MAX_WALLS):
        if len(remaining) < MIN_REMAINING_POINTS or len(found) == MAX_WALLS:
            break
        normal, offset = _fitted_line(remaining, *_strongest_line(remaining))
        near = np.abs(remaining @ normal - offset) < BAND_M
        along = remaining[near] @ np.array([-normal[1], normal[0]])
        if not near.any():
            break
        cells, counts = np.unique(np.floor(along / PIECE_M), return_counts=True)
        seen = cells[counts >= MIN_POINTS_PER_PIECE]
        if len(seen) * PIECE_M >= min_length_m:
            low, high = float(seen[0]), float(seen[-1] + 1.0)
            found.append((*map(float, normal), offset, PIECE_M * low, PIECE_M * high))
        remaining = remaining[~near]
    lines = np.array(found).reshape(-1, 5)
    return Walls(lines[:, :2], lines[:, 2], lines[:, 3:])


def _strongest_line(points: Floats) -> tuple[Floats, float]:
    """Normal (2,) and offset of the line with the most votes in the Hough accumulator."""
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


def _fitted_line(points: Floats, normal: Floats, offset: float) -> tuple[Floats, float]:
    """Line fitted to the medians of its pieces, so that a piece seen often does not count more."""
    for _ in range(FIT_ROUNDS):
        error = points @ normal - offset
        near = np.abs(error) < BAND_M
        if np.count_nonzero(near) < 3:
            break
        along = np.array([-normal[1], normal[0]])
        pieces = _piece_medians(points[near] @ along, error[near])
        normal, offset = _line_through(pieces, normal, along, offset)
    return normal, offset


def _piece_medians(along: Floats, error: Floats) -> Floats:
    """Mean position along the line and median distance from it `(k, 2)`, per piece of `PIECE_M`."""
    cell = np.floor(along / PIECE_M).astype(np.int64)
    order = np.lexsort((error, cell))
    cell, along, error = cell[order], along[order], error[order]
    first = np.flatnonzero(np.r_[True, cell[1:] != cell[:-1]])
    count = np.diff(np.r_[first, len(cell)])
    middle = 0.5 * (error[first + (count - 1) // 2] + error[first + count // 2])
    return np.column_stack([np.add.reduceat(along, first) / count, middle])


def _line_through(pieces: Floats, normal: Floats, along: Floats, offset: float) -> tuple[Floats, float]:
    """Normal and offset of the line through pieces `(k, 2)`, whose coordinates are along and across another line.

    Geman-McClure weights, with a scale that shrinks from the band to its final value, leave the majority of the pieces.
    """
    scale = BAND_M
    line: Floats = np.zeros(2)
    design = np.column_stack([np.ones(len(pieces)), pieces[:, 0] - pieces[:, 0].mean()])
    for _ in range(FIT_ITERATIONS):
        weight = (scale**2 / (scale**2 + (pieces[:, 1] - design @ line) ** 2)) ** 2
        normal_matrix = design.T @ (design * weight[:, None]) + REGULARISATION * np.eye(2)
        line = np.asarray(np.linalg.solve(normal_matrix, design.T @ (weight * pieces[:, 1])))
        scale = max(SCALE_FACTOR * scale, FINAL_BAND_M)
    tilted = normal - line[1] * along
    tilted = tilted / np.hypot(*tilted)
    point = normal * (offset + line[0]) + along * pieces[:, 0].mean()
    return tilted, float(tilted @ point)
