"""The last scans as one: a small local map around the robot that tells places apart which one scan does not.

Odometry alone would smear it, so every scan is matched to the one before when the window is asked for.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.correlative_matching import FieldPyramid, SearchWindow, correlate, field_pyramid
from gridslam.methods.ispace_mcl.config import SearchConfig
from gridslam.sensors.sight import Segments

Floats = NDArray[np.float64]

_CELL_M = 0.05
_LEVELS = 4
_REACH_M = 12.0  # points farther away are too sparse to match one scan to the next
_SPLAT_CELLS = 3
_SPLAT_SIGMA = 1.5  # cells
_YAW_STEP_RAD = 0.01
_MATCH_POINTS = 90
_LEAST_SCORE = 60.0  # of 255
_KEPT_POINTS = 360


@dataclass(slots=True)
class _Entry:
    """A scan's points `(m, 2)` in the robot's frame, and T_previous_this by odometry, later by matching."""

    odometry: Floats
    viewpoint: Floats
    points: Floats
    step: Floats
    is_matched: bool

    def segments(self, most: int) -> Segments:
        """At most so many of the beams, evenly spread over the scan."""
        ends = self.points[_evenly(len(self.points), most)]
        return Segments(np.broadcast_to(self.viewpoint, ends.shape), ends)


@dataclass(frozen=True, slots=True)
class PastScan:
    """A scan's beams in the robot's frame of its moment, and T_before_this to the scan before it."""

    step: Floats
    segments: Segments


class ScanWindow:
    """The scans of the last stretch of way."""

    def __init__(self, config: SearchConfig) -> None:
        self._config = config
        self._entries: deque[_Entry] = deque(maxlen=config.past_scans)

    def __len__(self) -> int:
        return len(self._entries)

    def clear(self) -> None:
        """Forget everything, as after a jump of the odometry."""
        self._entries.clear()

    def add(self, odometry: Floats, viewpoint: Floats, points: Floats) -> None:
        """Take in a scan at T_odom_base `(3,)`, seen from the viewpoint `(2,)` in the robot's frame.

        Where the one before is close to the one before that, the new one takes its place.
        """
        kept = points if len(points) <= _KEPT_POINTS else points[_evenly(len(points), _KEPT_POINTS)]
        if not self._entries:
            self._entries.append(_Entry(odometry, viewpoint, kept, np.zeros(3), True))
            return
        if len(self._entries) > 1:
            before = self._entries[-2]
            step = se2.between(before.odometry, self._entries[-1].odometry)
            if self._is_near(step):
                self._entries.pop()
        step = se2.between(self._entries[-1].odometry, odometry)
        self._entries.append(_Entry(odometry, viewpoint, kept, step, False))

    def recent(self, most: int) -> Segments:
        """The beams of the last scans in the robot's present frame as one, at most so many, evenly many of each scan."""
        self._match()
        entries = list(self._entries)[-self._config.window_scans :]
        starts, ends = [], []
        pose, travelled = np.zeros(3), 0.0
        share = max(most // max(len(entries), 1), 1)
        for entry in reversed(entries):
            if len(entry.points):
                segments = entry.segments(share)
                starts.append(se2.transform_points(pose, segments.starts))
                ends.append(se2.transform_points(pose, segments.ends))
            travelled += float(np.hypot(entry.step[0], entry.step[1]))
            if travelled > self._config.window_m:
                break
            pose = se2.compose(pose, se2.inverse(entry.step))
        if not ends:
            return Segments(np.zeros((0, 2)), np.zeros((0, 2)))
        return Segments(np.concatenate(starts), np.concatenate(ends))

    def past(self, beams: int) -> list[PastScan]:
        """All scans from the latest to the oldest, each with at most so many beams."""
        self._match()
        return [PastScan(entry.step, entry.segments(beams)) for entry in reversed(self._entries)]

    def _match(self) -> None:
        """Correct the steps that are odometry's alone."""
        for before, entry in pairwise(self._entries):
            if not entry.is_matched:
                entry.step = matched_step(before.points, entry.points, entry.step)
                entry.is_matched = True

    def _is_near(self, step: Floats) -> bool:
        return float(np.hypot(step[0], step[1])) < self._config.window_step_m and abs(float(step[2])) < 0.3


def matched_step(before: Floats, after: Floats, step: Floats) -> Floats:
    """T_before_after near an odometry step such that the points `(m, 2)` of both scans fall together, else the step itself."""
    reach = int(_REACH_M / _CELL_M)
    near = np.abs(after).max(axis=1, initial=0.0) < _REACH_M - 2.0
    moving = after[near]
    if len(moving) < 20:
        return step
    field, origin = _splatted(before, reach)
    way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    window_m = 0.15 + 0.3 * way
    yaw_steps = int(np.ceil((0.06 + 0.3 * turn + 0.3 * way) / _YAW_STEP_RAD))
    found, score = correlate(
        FieldPyramid(field_pyramid(field, _LEVELS), origin, _CELL_M),
        np.ascontiguousarray(moving[_evenly(len(moving), min(_MATCH_POINTS, len(moving)))]),
        step,
        SearchWindow(window_m, _YAW_STEP_RAD, yaw_steps),
        _LEAST_SCORE,
    )
    return step if score < 0.0 else np.asarray(found)


def _splatted(points: Floats, reach: int) -> tuple[NDArray[np.uint8], Floats]:
    """A field of Gaussian spots at the points, and its lower-left corner; with the margin that its pyramid needs."""
    half = reach + (1 << _LEVELS) + _SPLAT_CELLS
    field = np.zeros((2 * half, 2 * half), np.uint8)
    cells = np.floor(points / _CELL_M).astype(np.int64) + half
    inside = ((cells >= _SPLAT_CELLS) & (cells < 2 * half - _SPLAT_CELLS)).all(axis=1)
    cells = cells[inside]
    for dr in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
        for dc in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
            value = np.uint8(round(255.0 * np.exp(-0.5 * (dr * dr + dc * dc) / _SPLAT_SIGMA**2)))
            rows, cols = cells[:, 1] + dr, cells[:, 0] + dc
            field[rows, cols] = np.maximum(field[rows, cols], value)
    return field, np.array([-half * _CELL_M, -half * _CELL_M])


def _evenly(n: int, most: int) -> NDArray[np.int64]:
    return (np.arange(min(most, n)) * n) // max(min(most, n), 1)
