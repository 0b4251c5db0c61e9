"""The last scans joined to a small local map around the robot, which distinguishes places that a single scan does not.

Odometry alone would blur the map, so consecutive scans are matched to each other when the window is used.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.kernels.scan_matching.correlative_matching import (
    FieldPyramid,
    SearchWindow,
    correlate,
    field_pyramid,
)
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation
from gridslam.methods.ispace_mcl.continuity import overlap_of
from gridslam.methods.ispace_mcl.local_map import LocalMap, local_map
from gridslam.sensors.pose_search import climb
from gridslam.sensors.visibility import BeamSegments

Floats = NDArray[np.float64]

MAX_TRAVEL_M = 4.0  # length of the path whose scans are searched for together
MAX_SEARCH_SCANS = 10  # largest number of scans that are searched for together
MIN_STEP_M = 0.4  # smallest travel between the scans of the window ...
MIN_STEP_RAD = 0.3  # ... or the smallest rotation
MAP_POINTS = 180  # largest number of points of each scan in the local map
MAX_SCANS = 50  # scans that are kept, for tracing hypotheses back

_CELL_M = 0.05  # cell of the matching field; the refinement (`_STEPS`) goes on within it
_LEVELS = 4  # levels of its pyramid, whose widest cell has 0.4 m
_HALF_WIDTH_M = 12.0  # half width of the matching field; points farther away are too sparse to match
_MARGIN_M = 2.0  # points so near to the field's border are not matched: they may leave it
_SPLAT_CELLS = 3
_SPLAT_STD_CELLS = 1.5
_YAW_STEP_RAD = 0.01
_MATCH_POINTS = 90
_MIN_MATCH_POINTS = 20
_MIN_SCORE = 60.0  # smallest score of a match, of at most 255
_MAX_POINTS = 360
# How far the odometry is trusted against the match: a fixed part and parts that grow with travel and rotation ...
_ODOMETRY_M, _ODOMETRY_PER_M = 0.02, 0.1
_ODOMETRY_RAD, _ODOMETRY_RAD_PER_RAD, _ODOMETRY_RAD_PER_M = 0.02, 0.1, 0.05
# ... and the log-likelihood of a perfect match: of fewer than all points, whose errors are common
_MATCH_WEIGHT = 40.0
_STEPS = ((0.1, 0.03), (0.1, 0.02), (0.05, 0.02), (0.05, 0.01), (0.025, 0.01), (0.025, 0.005))  # m, rad
# Search window of a match: a fixed part and parts that grow with the odometry's travel and rotation.
_SEARCH_M, _SEARCH_PER_M = 0.15, 0.3
_SEARCH_RAD, _SEARCH_RAD_PER_RAD, _SEARCH_RAD_PER_M = 0.06, 0.3, 0.3


@dataclass(slots=True)
class _WindowScan:
    """Points `(m, 2)` and sensor position `(2,)` in the robot's frame, and T_previous_this by odometry or by matching.

    `observations` are those of the fixed cameras since the scan before; `tracked` `(3,)` is the filter's pose at the scan.
    `overlap` is the smallest one of consecutive scans since the scan before: 1 if they continue each other.
    """

    odometry: Floats
    viewpoint: Floats
    points: Floats
    step: Floats
    is_matched: bool
    observations: list[CameraObservation]
    overlap: float = 1.0
    tracked: Floats | None = None

    def beams(self, max_beams: int) -> BeamSegments:
        """At most `max_beams` of the beams, evenly from the scan."""
        endpoints = self.points[evenly_spaced(len(self.points), max_beams)]
        return BeamSegments(np.broadcast_to(self.viewpoint, endpoints.shape), endpoints)


@dataclass(frozen=True, slots=True)
class PastScan:
    """A scan's beams in the robot's frame at its stamp, T_previous_this `(3,)` from the scan before it, the observations of
    the fixed cameras since then, and the filter's pose `(3,)` at the scan, None if it has been elsewhere since; and how far the
    scans since the scan before continue each other, from 0 to 1.
    """

    step: Floats
    beams: BeamSegments
    surface: BeamSegments
    observations: Sequence[CameraObservation]
    tracked: Floats | None = None
    overlap: float = 1.0


class ScanWindow:
    """The scans of the last metres of travel, at least `min_step_m` apart."""

    def __init__(self, min_step_m: float = MIN_STEP_M) -> None:
        self._min_step_m = min_step_m
        self._scans: deque[_WindowScan] = deque(maxlen=MAX_SCANS)
        self.last_overlap = 1.0  # of the last scan with the one before it

    def __len__(self) -> int:
        return len(self._scans)

    def clear(self) -> None:
        """Remove all scans, as after a jump of the odometry."""
        self._scans.clear()

    def add(
        self,
        odometry: Floats,
        viewpoint: Floats,
        points: Floats,
        observations: Sequence[CameraObservation] = (),
    ) -> None:
        """Add a scan at T_odom_base `(3,)` with sensor position `(2,)` and points `(m, 2)` in the robot's frame.

        The new scan replaces the last one if that is close to the one before. The last one's `observations` of the fixed cameras
        are kept.
        """
        kept = points[evenly_spaced(len(points), _MAX_POINTS)]
        if not self._scans:
            first = _WindowScan(
                odometry=odometry,
                viewpoint=viewpoint,
                points=kept,
                step=np.zeros(3),
                is_matched=True,
                observations=list(observations),
            )
            self._scans.append(first)
            self.last_overlap = 1.0
            return
        last, earlier = self._scans[-1], []
        self.last_overlap = overlap = overlap_of(last.points, kept, se2.between(last.odometry, odometry))
        if len(self._scans) > 1 and self._is_close(se2.between(self._scans[-2].odometry, last.odometry)):
            step = se2.between(last.odometry, odometry)
            earlier = [observation.seen_after(step) for observation in self._scans.pop().observations]
            overlap = min(overlap, last.overlap)
        step = se2.between(self._scans[-1].odometry, odometry)
        seen = [*earlier, *observations]
        self._scans.append(
            _WindowScan(
                odometry=odometry,
                viewpoint=viewpoint,
                points=kept,
                step=step,
                is_matched=False,
                observations=seen,
                overlap=overlap,
            )
        )

    def track(self, pose: Floats) -> None:
        """Store the filter's pose `(3,)` at the last scan."""
        self._scans[-1].tracked = pose

    def lose_track(self) -> None:
        """Forget the filter's poses, as when it is elsewhere now."""
        for scan in self._scans:
            scan.tracked = None

    def keep_latest(self, count: int) -> None:
        """Remove the scans from before the robot was carried elsewhere."""
        while len(self._scans) > count:
            self._scans.popleft()

    def recent(self, max_beams: int, travel_m: float = MAX_TRAVEL_M) -> BeamSegments:
        """The surfaces of the last metres in the robot's present frame, as at most `max_beams` beams spread evenly over them."""
        self._match()
        beams = self._local_map(travel_m).beams
        chosen = evenly_spaced(len(beams), max_beams)
        return BeamSegments(beams.origins[chosen], beams.endpoints[chosen])

    def past(self, max_beams: int) -> list[PastScan]:
        """All scans from the latest to the oldest, each with at most `max_beams` beams."""
        self._match()
        surfaces, poses = self._local_map(np.inf), self._poses()
        past = []
        for row, s in enumerate(reversed(self._scans)):
            mine = surfaces.scans == row
            inverse = se2.inverse(poses[row])
            surface = BeamSegments(
                se2.transform_points(inverse, surfaces.beams.origins[mine]),
                se2.transform_points(inverse, surfaces.beams.endpoints[mine]),
            )
            past.append(PastScan(s.step, s.beams(max_beams), surface, s.observations, s.tracked, s.overlap))
        return past

    def _poses(self) -> Floats:
        """The poses `(k, 3)` of the scans in the robot's present frame, latest first."""
        poses = [np.zeros(3)]
        for scan in list(reversed(self._scans))[:-1]:
            poses.append(se2.compose(poses[-1], se2.inverse(scan.step)))
        return np.stack(poses)

    def _local_map(self, travel_m: float) -> LocalMap:
        """The surfaces that the scans of the last metres show."""
        scans = list(reversed(self._scans))
        poses = self._poses()
        travel = np.cumsum([0.0, *(np.hypot(s.step[0], s.step[1]) for s in scans[:-1])])
        count = int(np.searchsorted(travel, travel_m, side="right"))
        viewpoints = np.stack([s.viewpoint for s in scans[:count]])
        points = [s.points[evenly_spaced(len(s.points), MAP_POINTS)] for s in scans[:count]]
        return local_map(poses[:count], viewpoints, points)

    def _match(self) -> None:
        """Correct the steps that are still those of the odometry."""
        for before, scan in pairwise(self._scans):
            if not scan.is_matched:
                scan.step = matched_step(before.points, scan.points, scan.step)
                scan.is_matched = True

    def _is_close(self, step: Floats) -> bool:
        return float(np.hypot(step[0], step[1])) < self._min_step_m and abs(float(step[2])) < MIN_STEP_RAD


def matched_step(before: Floats, after: Floats, step: Floats) -> Floats:
    """T_before_after `(3,)` that aligns the points `(m, 2)` of two scans near an odometry step; the step itself if none does."""
    near = np.abs(after).max(axis=1, initial=0.0) < _HALF_WIDTH_M - _MARGIN_M
    moving = after[near]
    if len(moving) < _MIN_MATCH_POINTS:
        return step
    field, origin = _likelihood_image(before)
    travel_m, rotation_rad = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    window_m = _SEARCH_M + _SEARCH_PER_M * travel_m
    window_rad = _SEARCH_RAD + _SEARCH_RAD_PER_RAD * rotation_rad + _SEARCH_RAD_PER_M * travel_m
    yaw_steps = int(np.ceil(window_rad / _YAW_STEP_RAD))
    found, score = correlate(
        FieldPyramid(field_pyramid(field, _LEVELS), origin, _CELL_M),
        np.ascontiguousarray(moving[evenly_spaced(len(moving), _MATCH_POINTS)]),
        step,
        SearchWindow(window_m, _YAW_STEP_RAD, yaw_steps),
        _MIN_SCORE,
    )
    return step if score < 0.0 else _drawn_to_odometry(field, origin, moving, step, np.asarray(found))


def _drawn_to_odometry(
    field: NDArray[np.uint8], origin: Floats, points: Floats, step: Floats, found: Floats
) -> Floats:
    """The step `(3,)` that agrees best with the points `(m, 2)` on the other scan's image and with the odometry step.

    Along a corridor all steps match about as well, and the match alone prefers those that are too short.
    """
    travel_m, rotation_rad = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    std_m = _ODOMETRY_M + _ODOMETRY_PER_M * travel_m
    std_rad = _ODOMETRY_RAD + _ODOMETRY_RAD_PER_RAD * rotation_rad + _ODOMETRY_RAD_PER_M * travel_m
    std = np.array([std_m, std_m, std_rad])

    def score(steps: Floats) -> Floats:
        moved = np.stack([se2.transform_points(tried, points) for tried in steps])
        cols, rows = np.moveaxis(np.floor((moved - origin) / _CELL_M).astype(np.int64), 2, 0)
        match = field[rows.clip(0, len(field) - 1), cols.clip(0, len(field) - 1)].mean(axis=1) / 255.0
        return np.asarray(_MATCH_WEIGHT * match - 0.5 * np.sum(((steps - step) / std) ** 2, axis=1))

    steps = np.stack([found, step])
    scores = score(steps)
    for step_m, step_rad in _STEPS:
        steps, scores = climb(score, steps, scores, step_m, step_rad)
    return np.asarray(steps[scores.argmax()])


def _likelihood_image(points: Floats) -> tuple[NDArray[np.uint8], Floats]:
    """An image with a Gaussian splat at every point, with the margin that its pyramid needs, and its lower-left corner (m)."""
    half = int(_HALF_WIDTH_M / _CELL_M) + (1 << _LEVELS) + _SPLAT_CELLS
    image = np.zeros((2 * half, 2 * half), np.uint8)
    cells = np.floor(points / _CELL_M).astype(np.int64) + half
    inside = ((cells >= _SPLAT_CELLS) & (cells < 2 * half - _SPLAT_CELLS)).all(axis=1)
    cells = cells[inside]
    for dr in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
        for dc in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
            value = np.uint8(round(255.0 * np.exp(-0.5 * (dr * dr + dc * dc) / _SPLAT_STD_CELLS**2)))
            rows, cols = cells[:, 1] + dr, cells[:, 0] + dc
            image[rows, cols] = np.maximum(image[rows, cols], value)
    return image, np.array([-half * _CELL_M, -half * _CELL_M])
