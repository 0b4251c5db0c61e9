"""Finds lidars whose messages state a wrong angle between beams, by comparison with turns of the odometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan, as_float32
from gridslam.core.trajectory import Trajectory
from gridslam.core.turned_pairs import MAX_COST_RATIO, TurnedPairs
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of

Floats = NDArray[np.float64]

USUAL_STEPS_DEG = (0.25, 1.0 / 3.0, 0.5, 1.0, 2.0)
USUAL_RATIOS = (0.5, 2.0)
MIN_DIFFERENCE = 0.05  # smallest relative difference of another step
MAX_RATIO_OF_CONTRADICTED = 0.95  # largest ratio of the costs of two steps that one message states
MAX_SWEEP_RAD = 2.0 * math.pi * 1.05
# Those with most rotation, matched with either step: odometry may turn too much or too little as well
COMPARED_SCANS = 60
MIN_GAIN = 0.05  # smallest gain of the inlier ratio with the other step


@dataclass(frozen=True, slots=True)
class ScanAngles:
    """The angle between the beams of one lidar (rad), as found and as its messages state it."""

    lidar: str
    stated_rad: float
    step_rad: float

    @property
    def note(self) -> str:
        """One line for the user."""
        stated, step = math.degrees(self.stated_rad), math.degrees(self.step_rad)
        return (
            f"by the robot's turns the beams of {self.lidar} are {step:.4g} deg apart, not {stated:.4g}: used"
        )

    def applied_to(self, scan: LaserScan) -> LaserScan:
        """A scan of the lidar with the angles found; other scans unchanged."""
        if lidar_of(scan) != self.lidar or scan.angle_increment_rad != self.stated_rad:
            return scan
        return replace(scan, angle_increment_rad=as_float32(self.step_rad))


def find_wrong_angles(
    scans: Sequence[LaserScan], odometry: Trajectory, build_tracker: Callable[[], ScanTracker]
) -> list[ScanAngles]:
    """The lidars among the scans whose beams are clearly not as far apart as stated."""
    found = []
    for lidar in dict.fromkeys(map(lidar_of, scans)):
        own = [scan for scan in scans if lidar_of(scan) == lidar]
        beams, stated = len(own[0].ranges_m), own[0].angle_increment_rad
        own = [scan for scan in own if (len(scan.ranges_m), scan.angle_increment_rad) == (beams, stated)]
        contradicted = own[0].other_increment_rad
        is_contradicted = contradicted * stated > 0.0 and abs(contradicted) * (beams - 1) <= MAX_SWEEP_RAD
        others = [contradicted] if is_contradicted else _other_steps(beams, stated)
        if not others:
            continue
        poses, _ = odometry.at(np.array([scan.stamp_ns for scan in own], np.int64))
        pairs = TurnedPairs()
        for scan, pose in zip(own, poses.tolist(), strict=True):
            pairs.add(tuple(pose), scan.ranges_m)
        max_ratio = MAX_RATIO_OF_CONTRADICTED if is_contradicted else MAX_COST_RATIO
        step = pairs.better_step(beams, stated, others, max_ratio)
        if step is not None:
            angles = ScanAngles(lidar, stated, step)
            if is_contradicted or _matches_better(
                angles, _scans_in_rotation(own, poses[:, 2]), build_tracker
            ):
                found.append(angles)
    return found


def _other_steps(beams: int, stated_rad: float) -> list[float]:
    """Steps (rad) that lidars with this number of beams may have, in the stated sense; none for a whole circle."""
    if beams < 2 or abs(abs(stated_rad) * beams - 2.0 * math.pi) < 1.5 * abs(stated_rad):
        return []
    sizes = [math.radians(step) for step in USUAL_STEPS_DEG]
    sizes += [2.0 * math.pi / beams, *(ratio * abs(stated_rad) for ratio in USUAL_RATIOS)]
    return [
        math.copysign(size, stated_rad)
        for size in sizes
        if size * (beams - 1) <= MAX_SWEEP_RAD and abs(size / abs(stated_rad) - 1.0) > MIN_DIFFERENCE
    ]


def _scans_in_rotation(scans: Sequence[LaserScan], yaws: Floats) -> Sequence[LaserScan]:
    """The COMPARED_SCANS consecutive scans between which the robot turns most."""
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.unwrap(yaws))))])
    last = max(len(scans) - COMPARED_SCANS, 0)
    start = max(range(last + 1), key=lambda k: turned[min(k + COMPARED_SCANS, len(scans)) - 1] - turned[k])
    return scans[start : start + COMPARED_SCANS]


def _matches_better(
    angles: ScanAngles, scans: Sequence[LaserScan], build_tracker: Callable[[], ScanTracker]
) -> bool:
    """Whether scans match each other better with the angles found than with those stated."""
    ratios = []
    for used in (scans, [angles.applied_to(scan) for scan in scans]):
        tracker = build_tracker()
        tracker.track_all(used)
        ratios.append(float(np.mean(tracker.path.inlier_ratios)))
    return ratios[1] > ratios[0] + MIN_GAIN
