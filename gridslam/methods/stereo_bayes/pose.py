"""The robot's pose for stereo-bayes: odometry or visual odometry, and fixes from outside (paper section 1)."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import AbsolutePose, Odometry
from gridslam.methods.stereo_bayes.config import PoseConfig
from gridslam.motion.absolute_pose_filter import AbsolutePoseFilter, MotionNoise, PoseBelief

Floats = NDArray[np.float64]

_PATIENCE_NS = 3_000_000_000  # without a fix for so long the map begins where the robot stands
_START = PoseBelief(np.zeros(3), np.diag([1e-6, 1e-6, 1e-6]))


class RobotPose:
    """Knows which motion is used, and joins odometry that jumps."""

    def __init__(self, config: PoseConfig) -> None:
        noise = MotionNoise(config.translation_m, config.rotation_rad, config.rotation_per_m_rad)
        self._filter = AbsolutePoseFilter(noise, config.gate, config.window_s, config.reset_after, None)
        self._config = config
        self._raw: tuple[int, Floats] | None = None
        self._joined = np.zeros(3)
        self._begun_ns: int | None = None
        self._other: Counter[str] = Counter()
        self.is_visual: bool | None = {"odometry": False, "visual": True}.get(config.motion)

    @property
    def counters(self) -> Counter[str]:
        """Odometry and fixes used and skipped."""
        return self._other + self._filter.counters

    def add_odometry(self, odometry: Odometry) -> None:
        """Take in odometry, which `motion: auto` then goes by."""
        if self.is_visual is None:
            self.is_visual = False
        if self.is_visual:
            self._other["skipped.odom.visual_odometry_is_used"] += 1
            return
        pose = odometry.pose
        if self._raw is not None and np.isfinite(pose).all():
            step = se2.between(self._raw[1], pose)
            elapsed = (odometry.stamp_ns - self._raw[0]) * 1e-9
            if float(np.hypot(step[0], step[1])) > 0.5 + self._config.max_speed_mps * max(elapsed, 0.0):
                self._other["odometry.jumps"] += 1
            else:
                self._joined = se2.compose(self._joined, step)
        if np.isfinite(pose).all():
            self._raw = (odometry.stamp_ns, pose)
        self._other["used.odom"] += 1
        self._add(odometry.stamp_ns, self._joined)

    def add_step(self, stamp_ns: int, step: Floats | None) -> None:
        """Take in a motion by visual odometry; where it failed the robot is taken to move on as before."""
        if self._raw is None:
            c = self._config
            self._filter.set_noise(
                MotionNoise(c.visual_translation_m, c.visual_rotation_rad, c.visual_rotation_per_m_rad)
            )
        if step is None:
            self._other["visual_odometry.failures"] += int(self._raw is not None)
            step = np.zeros(3) if self._raw is None else self._raw[1]
        self._raw = (stamp_ns, step)
        self._joined = se2.compose(self._joined, step)
        self._add(stamp_ns, self._joined)

    def add_fix(self, fix: AbsolutePose) -> None:
        """Take in a pose from outside."""
        self._filter.add_fix(fix.stamp_ns, fix.pose, fix.covariance)

    def reaches(self, stamp_ns: int) -> bool:
        """Whether motion is known up to a moment, and the robot's place with it."""
        last = self._filter.last_stamp_ns
        return last is not None and last >= stamp_ns and self._filter.at(last) is not None

    def at(self, stamp_ns: int) -> PoseBelief | None:
        """T_map_base and its covariance at a moment."""
        return self._filter.at(stamp_ns)

    @property
    def is_fixed(self) -> bool:
        """Whether the map is tied to poses from outside."""
        return self._filter.is_fixed

    def begin(self) -> None:
        """Without any fix: the map begins at the first pose."""
        self._filter.begin(_START)

    def _add(self, stamp_ns: int, pose: Floats) -> None:
        self._filter.add_odometry(stamp_ns, pose)
        if self._begun_ns is None:
            self._begun_ns = stamp_ns
        if stamp_ns - self._begun_ns > _PATIENCE_NS:
            self._filter.begin(_START)
