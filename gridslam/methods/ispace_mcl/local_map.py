"""The surfaces that the last scans show, as beams spread evenly over them: a local map to be found on the map.

A box beside the robot ends a third of all beams, and a map that has aged may have many of them. Over the surfaces of some metres
of travel it is a small part. Moving people leave points all over the floor; where later scans pass, these are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.sensors.surface_points import first_in_squares
from gridslam.sensors.visibility import BeamSegments

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

SPACING_M = 0.3  # of the points: one in each square of this size
# Squares in which hits and passing beams are counted, up to this distance from the robot
_CELL_M, _HALF_WIDTH_M = 0.1, 8.0
_SIDE = 2 * int(_HALF_WIDTH_M / _CELL_M)
_BEFORE_M = 0.3  # a beam has passed all that lies farther than this before its endpoint
_PASSING_BEAMS = 120  # of each scan, by which passed squares are found


class LocalMap(NamedTuple):
    """Beams in the robot's present frame, one for each square of the surfaces, and the number `(m,)` of each beam's scan."""

    beams: BeamSegments
    scans: Ints


def local_map(poses: Floats, viewpoints: Floats, points: list[Floats]) -> LocalMap:
    """The local map of k scans at poses `(k, 3)` in the robot's present frame.

    `viewpoints` `(k, 2)` are the positions of the sensor and `points` the endpoints `(m, 2)`, in the robot's frame at each scan.
    Of the beams that end in a square the shortest counts: least stands in its way.
    """
    origins = np.stack([se2.transform_points(p, v[None])[0] for p, v in zip(poses, viewpoints, strict=True)])
    ends = [se2.transform_points(p, each) for p, each in zip(poses, points, strict=True)]
    counts = [len(each) for each in ends]
    scans, endpoints = np.repeat(np.arange(len(ends)), counts), np.concatenate(ends)
    kept = np.flatnonzero(_is_static(origins, ends))
    scans, endpoints = scans[kept], endpoints[kept]
    ranges = np.hypot(*(endpoints - origins[scans]).T)
    order = np.argsort(ranges, kind="stable")
    chosen = order[first_in_squares(endpoints[order], SPACING_M)]
    return LocalMap(BeamSegments(origins[scans[chosen]], endpoints[chosen]), scans[chosen])


def _is_static(origins: Floats, ends: list[Floats]) -> Bools:
    """Mask `(m,)` of all endpoints in whose square no more scans pass than end in it or beside it."""
    hits, passes = np.zeros((2, _SIDE, _SIDE), np.int64)
    for origin, endpoints in zip(origins, ends, strict=True):
        hit = np.zeros((_SIDE + 2, _SIDE + 2), np.bool_)
        rows, cols = _cells(endpoints)
        for row in range(3):
            for col in range(3):
                hit[rows + row, cols + col] = True
        passed = np.zeros((_SIDE, _SIDE), np.bool_)
        passed[_cells(_along(origin, endpoints[evenly_spaced(len(endpoints), _PASSING_BEAMS)]))] = True
        hits += hit[1:-1, 1:-1]
        passes += passed & ~hit[1:-1, 1:-1]
    static = hits >= passes
    return np.concatenate([_at(static, endpoints) for endpoints in ends])


def _along(origin: Floats, endpoints: Floats) -> Floats:
    """Points `(m, 2)` along the beams, where these have passed."""
    away = endpoints - origin
    ranges = np.hypot(away[:, 0], away[:, 1])
    steps = np.arange(0.0, 2.0 * _HALF_WIDTH_M, _CELL_M)
    beam, step = np.nonzero(steps < (ranges - _BEFORE_M)[:, None])
    return np.asarray(origin + away[beam] * (steps[step] / ranges[beam])[:, None])


def _cells(points: Floats) -> tuple[Ints, Ints]:
    """Rows and columns of the points that lie on the grid."""
    cells = np.floor(points / _CELL_M).astype(np.int64) + _SIDE // 2
    inside = ((cells >= 0) & (cells < _SIDE)).all(axis=1)
    return cells[inside, 1], cells[inside, 0]


def _at(grid: Bools, points: Floats) -> Bools:
    """The values `(m,)` of the grid at points `(m, 2)`; True beyond it."""
    cells = np.floor(points / _CELL_M).astype(np.int64) + _SIDE // 2
    inside = ((cells >= 0) & (cells < _SIDE)).all(axis=1)
    values = np.ones(len(points), np.bool_)
    values[inside] = grid[cells[inside, 1], cells[inside, 0]]
    return values
