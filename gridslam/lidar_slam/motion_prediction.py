"""Predicts the motion between scans: by odometry or, without it, at constant velocity and by a gyro."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Imu
from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.lidar_slam.odometry_noise import JUMP_STD, NO_MIN_STD
from gridslam.lidar_slam.odometry_trust import OdometryTrust
from gridslam.lidar_slam.prediction_errors import MIN_COMPARED_STEPS, PredictionErrors, VelocityChange
from gridslam.motion.gyro_heading import GyroHeading
from gridslam.motion.scan_poses import MAX_SCAN_GAP_S, PlacedScan, twist_between

Floats = NDArray[np.float64]

# Standard deviations of the motion at constant velocity: a floor, and what robots and people accelerate by, until the
# velocity's changes on this log are known.
TRANSLATION_FLOOR_M, ACCELERATION_MPS2, MAX_TRANSLATION_STD_M = 0.02, 2.0, 0.8
ROTATION_FLOOR_RAD, ACCELERATION_RADPS2, MAX_ROTATION_STD_RAD = 0.02, 5.0, 1.6
GYRO_FLOOR_RAD, GYRO_STD_PER_RAD = 0.01, 0.05
# A match with fewer inliers may be wrong: the robot counts as lost, and the search widens
MIN_INLIER_RATIO = 0.4
MIN_TWIST_S = 0.02  # no velocity is derived from scans closer in time, as those of two lidars are
FIRM_STD_M = 0.012  # standard deviation up to which a match shows how the velocity changes; no match along a corridor does
KEPT_SCANS = 16
MAX_LOST_S = 5.0  # after this time without a match the surroundings are new
# Rotation (rad) by which the errors of a gyro may exceed those at constant velocity, which is as good on straight drives
GYRO_TOLERANCE_RAD = 0.005
# Root mean square changes of motion from scan to scan beyond which a path without odometry is doubted: those of recorded logs
# whose paths were right are below 0.05 rad and 0.03 m.
MAX_CHANGE_M, MAX_CHANGE_RAD = 0.1, 0.15


class MotionSource(Enum):
    """Source of the predicted motion since the last scan."""

    ODOMETRY = "odometry"
    GYRO = "gyro_and_constant_velocity"
    CONSTANT_VELOCITY = "constant_velocity"


@dataclass(frozen=True, slots=True)
class PredictedMotion:
    """T_odom_base `(3,)` at a scan in a frame without jumps, and the smallest standard deviations `(3,)` of the step to it."""

    odometry: Floats
    min_std: Floats


class MotionPredictor:
    """Predicts the pose of every scan by the sources in the log; learns velocity and errors of the sources from matched scans."""

    def __init__(self) -> None:
        self._gyro = GyroHeading()
        self._errors = {source: PredictionErrors() for source in MotionSource}
        self._used = dict.fromkeys(MotionSource, 0)
        self._velocity_change = VelocityChange()
        self._trust = OdometryTrust()
        self._previous: PlacedScan | None = None
        # Scans with matched poses, newest last
        self._recent: deque[tuple[PlacedScan, Floats]] = deque(maxlen=KEPT_SCANS)
        self._previous_pose = np.zeros(3)  # matched
        self._previous_odometry = np.zeros(3)  # predicted, in the frame without jumps
        self._T_continuous_odom: Floats | None = None  # None: the frames are the same
        self._twist = np.zeros(3)
        self._twist_before = np.zeros(3)
        self._twist_ns = 0  # stamp of the scan whose matching gave the twist
        self._was_firm = False  # whether the last match was
        self._good_ns: int | None = None  # stamp of the last good match
        self._steps: dict[MotionSource, Floats] = {}  # steps by each source in the last prediction

    def add_imu(self, imu: Imu, is_flipped: bool) -> None:
        """Add a yaw rate."""
        self._gyro.add(imu, is_flipped)

    def twist(self, placed: PlacedScan) -> Floats:
        """Velocity (vx, vy, wz) `(3,)` at the next scan, as predicted before it is matched."""
        previous = self._previous
        if previous is None or (previous.has_odometry and self.uses_odometry(placed)):
            return twist_between(self._earlier(placed)[0], placed)
        elapsed_s = (placed.scan.stamp_ns - previous.scan.stamp_ns) * 1e-9
        if 0.0 <= elapsed_s < MIN_TWIST_S:
            return self._twist
        if not 0.0 < elapsed_s < MAX_SCAN_GAP_S:
            return np.zeros(3)
        source, step = self._step_without_odometry(placed.scan.stamp_ns, elapsed_s)
        if not step.any():
            return np.zeros(3)  # the last velocity is too old
        # The mean of two: an error of one matched step distorts the next scan, and would come back with the other sign.
        twist = 0.5 * (self._twist + self._twist_before)
        return np.array([twist[0], twist[1], step[2] / elapsed_s]) if source is MotionSource.GYRO else twist

    def uses_odometry(self, placed: PlacedScan) -> bool:
        """Whether a scan has odometry that agrees with the scans before."""
        return placed.has_odometry and self._trust.is_trusted

    def predict(self, placed: PlacedScan) -> PredictedMotion:
        """The motion to a scan; the first scan has no motion."""
        previous = self._previous
        self._steps = {}
        if self.uses_odometry(placed) and (previous is None or previous.has_odometry):
            offset = self._T_continuous_odom
            pose = placed.odometry if offset is None else se2.compose(offset, placed.odometry)
            self._steps[MotionSource.ODOMETRY] = se2.between(self._previous_odometry, pose)
            self._previous_odometry = pose
            self._used[MotionSource.ODOMETRY] += 1
            return PredictedMotion(pose, JUMP_STD if placed.odometry_jumped else NO_MIN_STD)
        if previous is None:
            self._used[MotionSource.CONSTANT_VELOCITY] += 1
            return PredictedMotion(np.zeros(3), NO_MIN_STD)
        elapsed_s = max((placed.scan.stamp_ns - previous.scan.stamp_ns) * 1e-9, 0.0)
        source, step = self._step_without_odometry(placed.scan.stamp_ns, elapsed_s)
        self._used[source] += 1
        if placed.has_odometry and not self._trust.is_trusted:
            self._trust.count()
        pose = np.asarray(se2.compose(self._previous_odometry, step))
        if placed.has_odometry:
            self._T_continuous_odom = se2.compose(pose, se2.inverse(placed.odometry))
        self._previous_odometry = pose
        uncertain_s = self._uncertain_s(placed.scan.stamp_ns, elapsed_s)
        std = _std_of(source, step, uncertain_s, self._velocity_change.std_m(uncertain_s))
        return PredictedMotion(pose, std)

    def add_match(self, placed: PlacedScan, match: ScanMatch) -> None:
        """Learn from the match of the scan of the last prediction."""
        previous, pose = self._previous, match.pose.copy()
        is_good = match.is_matched and match.inlier_ratio >= MIN_INLIER_RATIO
        if is_good:
            self._good_ns = placed.scan.stamp_ns
        is_firm = is_good and match.position_std_m < FIRM_STD_M
        if previous is not None and is_good:
            self._learn(placed, pose, is_firm)
        has_odometry = placed.has_odometry and not placed.odometry_jumped
        self._trust.add(placed.scan.stamp_ns, placed.odometry if has_odometry else None, pose, is_firm)
        self._previous, self._previous_pose = placed, pose
        self._recent.append((placed, pose))

    def measures(self) -> dict[str, object]:
        """Number of scans that each source predicted, and its errors, for the report."""
        return {
            source.value: {"predicted_scans": self._used[source], **self._errors[source].measures()}
            for source in MotionSource
            if self._used[source] or self._errors[source].steps
        }

    @property
    def notes(self) -> list[str]:
        """One line about odometry, and one about a gyro, that contradict the scans; empty where they are good."""
        found = [] if self._trust.note is None else [self._trust.note]
        if not self.is_gyro_poor:
            return found
        gyro, constant = (self._errors[s] for s in (MotionSource.GYRO, MotionSource.CONSTANT_VELOCITY))
        return [
            *found,
            f"the IMU's yaw rate contradicts the scans, by {math.degrees(gyro.rms_rad):.1f} deg a scan (constant velocity: "
            f"{math.degrees(constant.rms_rad):.1f} deg): wrong in sign, unit or time; not used",
        ]

    @property
    def is_gyro_poor(self) -> bool:
        """Whether the gyro's rotations are worse than those at constant velocity."""
        gyro, constant = (self._errors[s] for s in (MotionSource.GYRO, MotionSource.CONSTANT_VELOCITY))
        return gyro.steps >= MIN_COMPARED_STEPS and gyro.rms_rad > constant.rms_rad + GYRO_TOLERANCE_RAD

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust a path that no other passage confirms; None without one."""
        source = max(self._used, key=lambda source: self._used[source])
        errors = self._errors[source]
        if source is MotionSource.ODOMETRY or errors.steps < MIN_COMPARED_STEPS:
            return None
        if errors.rms_m <= MAX_CHANGE_M and errors.rms_rad <= MAX_CHANGE_RAD:
            return None
        return (
            f"without odometry the robot's motion changes by {errors.rms_m:.2f} m and {math.degrees(errors.rms_rad):.0f} deg "
            "from scan to scan, so the path is probably wrong; record odometry, or scans more often"
        )

    def _step_without_odometry(self, stamp_ns: int, elapsed_s: float) -> tuple[MotionSource, Floats]:
        """The better source and its step `(3,)` since the previous scan; `_steps` gets the steps of all."""
        is_recent = (stamp_ns - self._twist_ns) * 1e-9 < MAX_SCAN_GAP_S
        steady = self._twist * elapsed_s if is_recent else np.zeros(3)
        self._steps = {MotionSource.CONSTANT_VELOCITY: steady}
        rotation = (
            None if self._previous is None else self._gyro.rotation(self._previous.scan.stamp_ns, stamp_ns)
        )
        if rotation is None:
            return MotionSource.CONSTANT_VELOCITY, steady
        self._steps[MotionSource.GYRO] = np.array([steady[0], steady[1], rotation])
        source = MotionSource.CONSTANT_VELOCITY if self.is_gyro_poor else MotionSource.GYRO
        return source, self._steps[source]

    def _uncertain_s(self, stamp_ns: int, elapsed_s: float) -> float:
        """Time (s) since the last good match; since the previous scan where the match is too long ago."""
        if self._good_ns is None:
            return elapsed_s
        lost_s = (stamp_ns - self._good_ns) * 1e-9
        return lost_s if elapsed_s < lost_s < MAX_LOST_S else elapsed_s

    def _earlier(self, placed: PlacedScan) -> tuple[PlacedScan | None, Floats]:
        """The last scan that is MIN_TWIST_S or more before this one, with its matched pose; else the previous scan."""
        for earlier, pose in reversed(self._recent):
            if placed.scan.stamp_ns - earlier.scan.stamp_ns >= MIN_TWIST_S * 1e9:
                return earlier, pose
        return self._previous, self._previous_pose

    def _learn(self, placed: PlacedScan, pose: Floats, is_firm: bool) -> None:
        """Add the matched motion to a scan: since the previous scan, and since an earlier one for the velocity."""
        matched = se2.between(self._previous_pose, pose)
        for source, step in self._steps.items():
            self._errors[source].add(step, matched)
        self._learn_change(placed, matched, is_firm)
        end_ns = placed.scan.stamp_ns
        earlier, earlier_pose = self._earlier(placed)
        elapsed_s = 0.0 if earlier is None else (end_ns - earlier.scan.stamp_ns) * 1e-9
        if not MIN_TWIST_S <= elapsed_s < MAX_SCAN_GAP_S:
            return
        self._twist_before = self._twist
        self._twist, self._twist_ns = se2.between(earlier_pose, pose) / elapsed_s, end_ns
        if MotionSource.GYRO in self._steps and earlier is self._previous:
            self._gyro.compare(float(self._steps[MotionSource.GYRO][2]), float(matched[2]), elapsed_s)

    def _learn_change(self, placed: PlacedScan, matched: Floats, is_firm: bool) -> None:
        """Add the difference between the matched step `(3,)` and one at constant velocity, if both ends are certain."""
        steady = self._steps.get(MotionSource.CONSTANT_VELOCITY)
        previous, was_firm = self._previous, self._was_firm
        self._was_firm = is_firm
        if steady is None or previous is None or not (is_firm and was_firm):
            return
        elapsed_s = (placed.scan.stamp_ns - previous.scan.stamp_ns) * 1e-9
        if MIN_TWIST_S <= elapsed_s < MAX_SCAN_GAP_S:
            self._velocity_change.add(math.hypot(*(matched - steady)[:2].tolist()), elapsed_s)


def _std_of(source: MotionSource, step: Floats, elapsed_s: float, known_std_m: float) -> Floats:
    """Standard deviations `(3,)` of a step `(3,)` predicted without odometry; the translation's is at most `known_std_m`."""
    translation = min(
        TRANSLATION_FLOOR_M + ACCELERATION_MPS2 * elapsed_s**2, MAX_TRANSLATION_STD_M, known_std_m
    )
    rotation = min(ROTATION_FLOOR_RAD + ACCELERATION_RADPS2 * elapsed_s**2, MAX_ROTATION_STD_RAD)
    if source is MotionSource.GYRO:
        rotation = min(GYRO_FLOOR_RAD + GYRO_STD_PER_RAD * abs(float(step[2])), rotation)
    return np.array([translation, translation, rotation])
