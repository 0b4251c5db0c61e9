"""Whether a contradiction is a displaced passage: would both passages agree if one of them were moved?

Doors and furniture that were moved cause contradictions as well, but no displacement of a whole passage explains those.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.map_consistency.contradictions import Contradiction
from gridslam.lidar_slam.map_consistency.observations import Observations
from gridslam.lidar_slam.map_consistency.passages import Passages

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_SHIFT_M, SHIFT_STEP_M = 6.0, 0.4
MIN_SHIFT_M = 0.7  # shorter ones are within the tolerances of the comparison
FREE_COST = 3.0  # cost of a point in free space, in points on a surface
MAX_SEEING = 3
SEEING_STEPS = (-4, 0, 4)  # scans around one that sees contradicted points
JUDGING_STEPS = (-6, -3, 0, 3, 6)  # scans around the one that looks through most of the contradicted points
POINT_STEP = 2  # every second point of a scan is moved


@dataclass(frozen=True, slots=True)
class Displacement:
    """The displacement (m) of one passage, how much better it agrees when it is moved back, and the two scans that show it.

    `gain` is the increase, per comparison of a point with a scan, of points on surfaces minus `FREE_COST` times the points in
    free space: about 1 if a passage is displaced, about 0 if an object was moved.
    """

    dx_m: float
    dy_m: float
    gain: float
    seen_by: int
    looked_through_by: int


def find_displacement(place: Contradiction, observations: Observations, passages: Passages) -> Displacement:
    """The displacement that explains a contradiction best."""
    found = [
        _displacement_of(scan, place, observations, passages) for scan in _seeing_scans(place, observations)
    ]
    return max(found, key=lambda displacement: displacement.gain)


def _seeing_scans(place: Contradiction, observations: Observations) -> list[int]:
    """The scans that see most of a place, at most `MAX_SEEING` and not next to each other."""
    scans, counts = np.unique(observations.scan[place.points], return_counts=True)
    chosen: list[int] = []
    for scan in scans[np.argsort(-counts, kind="stable")].tolist():
        if len(chosen) < MAX_SEEING and all(abs(scan - other) > SEEING_STEPS[-1] for other in chosen):
            chosen.append(scan)
    return chosen


def _displacement_of(
    seeing: int, place: Contradiction, observations: Observations, passages: Passages
) -> Displacement:
    """The displacement that makes one scan and its neighbours agree best with the scan that contradicts it most."""
    seen = observations.points[place.points[observations.scan[place.points] == seeing]]
    judging = _looking_through(seen, passages.others(seeing), observations)
    count = len(observations.poses)
    points = np.concatenate(
        [
            observations.points[observations.first[k] : observations.first[k + 1] : POINT_STEP]
            for k in _around(seeing, SEEING_STEPS, count)
        ]
    )
    judges = _around(judging, JUDGING_STEPS, count)
    shifts = _shifts()
    free, occupied = observations.of_shifts(points, shifts, judges)
    score = (occupied - FREE_COST * free) / (len(points) * len(judges))
    best = int(np.argmax(score[1:])) + 1
    dx, dy = shifts[best].tolist()
    return Displacement(dx, dy, float(score[best] - score[0]), seeing, judging)


def _looking_through(points: Floats, candidates: Ints, observations: Observations) -> int:
    """The scan that sees most of the points free."""
    free = [
        int(observations.of_shifts(points, np.zeros((1, 2)), candidates[[k]])[0][0])
        for k in range(len(candidates))
    ]
    return int(candidates[int(np.argmax(free))])


def _around(scan: int, steps: tuple[int, ...], count: int) -> Ints:
    return np.array([scan + step for step in steps if 0 <= scan + step < count], np.int64)


def _shifts() -> Floats:
    """No shift, then all on a square grid beyond `MIN_SHIFT_M`."""
    axis = np.arange(-MAX_SHIFT_M, MAX_SHIFT_M + 1e-9, SHIFT_STEP_M)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return np.concatenate([np.zeros((1, 2)), grid[np.hypot(grid[:, 0], grid[:, 1]) >= MIN_SHIFT_M]])
