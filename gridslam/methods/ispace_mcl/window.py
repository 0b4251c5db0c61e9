"""The last scans joined to a local map around the robot, which distinguishes places that a single scan does not.

Odometry alone would blur the map, so consecutive scans are matched to each other when the window is used.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance, evenly_spaced
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation
from gridslam.methods.ispace_mcl.continuity import overlap_of
from gridslam.methods.ispace_mcl.local_map import LocalMap, local_map
from gridslam.methods.ispace_mcl.step_matching import matched_step
from gridslam.sensors.visibility import BeamSegments

Floats = NDArray[np.float64]

MIN_STEP_M = 0.4  # smallest travel between the scans of the window ...
MIN_STEP_RAD = 0.3  # ... or the smallest rotation
MAX_SCANS = 50  # scans that are kept, for tracing hypotheses back

_MAX_POINTS = 360  # largest number of points of a scan that are kept
_MAP_POINTS = 180  # largest number of these in a local map


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
    scans since the scan before continue each other, from 0 to 1. `surface` are the beams to what it shows of the surfaces around
    the path: each piece of a surface belongs to one scan.
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

    def recent(self, travel_m: float, max_beams: int) -> BeamSegments:
        """At most `max_beams` beams in the robot's present frame, spread evenly over the surfaces of the last metres."""
        self._match()
        if not self._scans:
            return BeamSegments(np.zeros((0, 2)), np.zeros((0, 2)))
        beams = self._local_map(travel_m).beams
        chosen = evenly_spaced(len(beams), max_beams)
        return BeamSegments(beams.origins[chosen], beams.endpoints[chosen])

    def past(self, max_beams: int) -> list[PastScan]:
        """All scans from the latest to the oldest, each with at most `max_beams` beams and with its part of the surfaces."""
        self._match()
        if not self._scans:
            return []
        surfaces, past = self._local_map(np.inf), []
        for row, (scan, pose) in enumerate(zip(reversed(self._scans), self._poses(), strict=True)):
            T_then_now, own = se2.inverse(pose), surfaces.scans == row
            origins, endpoints = (
                se2.transform_points(T_then_now, points[own])
                for points in (surfaces.beams.origins, surfaces.beams.endpoints)
            )
            past.append(
                PastScan(
                    step=scan.step,
                    beams=scan.beams(max_beams),
                    surface=BeamSegments(origins, endpoints),
                    observations=scan.observations,
                    tracked=scan.tracked,
                    overlap=scan.overlap,
                )
            )
        return past

    def _poses(self) -> Floats:
        """The poses `(k, 3)` of the scans in the robot's present frame, latest first."""
        poses = [np.zeros(3)]
        for scan in islice(reversed(self._scans), len(self._scans) - 1):
            poses.append(se2.compose(poses[-1], se2.inverse(scan.step)))
        return np.stack(poses)

    def _local_map(self, travel_m: float) -> LocalMap:
        """The surfaces that the scans of the last metres show, numbered from the latest scan."""
        poses = self._poses()
        travel = cumulative_distance(poses)
        count = int(np.searchsorted(travel, travel_m, side="right"))
        scans = list(islice(reversed(self._scans), count))
        return local_map(
            poses[:count],
            np.stack([scan.viewpoint for scan in scans]),
            [scan.points[evenly_spaced(len(scan.points), _MAP_POINTS)] for scan in scans],
        )

    def _match(self) -> None:
        """Correct the steps that are still those of the odometry."""
        for before, scan in pairwise(self._scans):
            if not scan.is_matched:
                scan.step = matched_step(before.points, scan.points, scan.step)
                scan.is_matched = True

    def _is_close(self, step: Floats) -> bool:
        return float(np.hypot(step[0], step[1])) < self._min_step_m and abs(float(step[2])) < MIN_STEP_RAD
