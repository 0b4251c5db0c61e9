"""Robot pose for stereo-bayes from odometry or visual odometry, fused with absolute poses (paper section 1)."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import AbsolutePose, Odometry
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.motion.absolute_pose_filter import (
    AbsolutePoseFilter,
    FilterSettings,
    PoseBelief,
    RootMotionNoise,
)

Floats = NDArray[np.float64]

# After this time without an absolute pose, the map's origin is placed at the robot's first pose.
START_AFTER_NS = 3_000_000_000
START = PoseBelief(np.zeros(3), np.diag([1e-6, 1e-6, 1e-6]))
# Noise of visual odometry, chosen on KITTI and in simulated rooms
VISUAL_NOISE = RootMotionNoise(translation_m=0.02, rotation_rad=0.01, rotation_per_m_rad=0.003)
# A step longer than MAX_SPEED_MPS * time + JUMP_TOLERANCE_M is a jump
MAX_SPEED_MPS, JUMP_TOLERANCE_M = 30.0, 0.5
FILTER = FilterSettings()
WINDOW_NS = int(FILTER.window_s * 1e9)  # maximum delay of an absolute pose that is still used


class RobotPose:
    """Estimates T_map_base from one source of motion and from absolute poses.

    The source is odometry, whose jumps are removed, or visual odometry. `is_visual` says which of them is used; it is None while
    `motion: auto` has not selected one.
    """

    def __init__(self, config: StereoBayesConfig) -> None:
        noise = config.advanced.pose
        self._filter = AbsolutePoseFilter(
            RootMotionNoise(noise.translation_std_m, noise.rotation_std_rad, noise.rotation_std_per_m_rad),
            FILTER,
            None,
        )
        self._last_odometry: tuple[int, Floats] | None = None  # stamp (ns) and pose
        self._last_step: Floats | None = None  # of visual odometry
        self._pose = np.zeros(3)  # T_odom_base without the jumps, or the composed steps of visual odometry
        self._first_ns: int | None = None
        self._motion_counters: Counter[str] = Counter()
        self.is_visual: bool | None = {"odometry": False, "visual": True}.get(config.pose.motion)

    @property
    def counters(self) -> Counter[str]:
        """Numbers of used and skipped odometry messages and absolute poses, odometry jumps, and failures of visual odometry."""
        return self._motion_counters + self._filter.counters

    def add_odometry(self, odometry: Odometry) -> None:
        """Add an odometry message. It is skipped if visual odometry is used; `motion: auto` selects odometry at the first one."""
        if self.is_visual is None:
            self.is_visual = False
        if self.is_visual:
            self._motion_counters["skipped.odom.visual_odometry_is_used"] += 1
            return
        pose = odometry.pose
        if self._last_odometry is not None and np.isfinite(pose).all():
            last_ns, last_pose = self._last_odometry
            step = se2.between(last_pose, pose)
            elapsed_s = (odometry.stamp_ns - last_ns) * 1e-9
            max_step_m = JUMP_TOLERANCE_M + MAX_SPEED_MPS * max(elapsed_s, 0.0)
            if float(np.hypot(step[0], step[1])) > max_step_m:
                self._motion_counters["odometry.jumps"] += 1
            else:
                self._pose = se2.compose(self._pose, step)
        if np.isfinite(pose).all():
            self._last_odometry = (odometry.stamp_ns, pose)
        self._motion_counters["used.odom"] += 1
        self._add(odometry.stamp_ns, self._pose)

    def add_step(self, stamp_ns: int, step: Floats | None) -> None:
        """Add the motion `(3,)` by visual odometry since the previous frame; None (failure) repeats the previous motion."""
        if self._last_step is None:
            self._filter.set_noise(VISUAL_NOISE)
        if step is None:
            self._motion_counters["visual_odometry.failures"] += int(self._last_step is not None)
            step = np.zeros(3) if self._last_step is None else self._last_step
        self._last_step = step
        self._pose = se2.compose(self._pose, step)
        self._add(stamp_ns, self._pose)

    def add_absolute_pose(self, measured: AbsolutePose) -> None:
        """Add a measured T_map_base, for example from an external tracking system."""
        self._filter.add_absolute_pose(measured.stamp_ns, measured.pose, measured.covariance)

    def is_known_at(self, stamp_ns: int) -> bool:
        """Whether the motion is known up to this stamp, and the latest pose in the map is known."""
        last = self._filter.last_stamp_ns
        return last is not None and last >= stamp_ns and self._filter.at(last) is not None

    def at(self, stamp_ns: int) -> PoseBelief | None:
        """T_map_base with covariance at a stamp; None if the pose is unknown then."""
        return self._filter.at(stamp_ns)

    @property
    def is_absolute(self) -> bool:
        """Whether an absolute pose has been used; if not, the map drifts with the odometry."""
        return self._filter.is_absolute

    def start(self) -> None:
        """Place the map's origin at the robot's first pose, unless an absolute pose has been used."""
        self._filter.start_at(START)

    def _add(self, stamp_ns: int, pose: Floats) -> None:
        self._filter.add_odometry(stamp_ns, pose)
        if self._first_ns is None:
            self._first_ns = stamp_ns
        if stamp_ns - self._first_ns > START_AFTER_NS:
            self._filter.start_at(START)
