"""The part of stereo-bayes that mapping and localization have in common: from messages to frames with the robot's pose."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping

import numpy as np

from gridslam.core.errors import MethodError
from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    Disparity,
    Event,
    Odometry,
    StereoPair,
    Transform,
)
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Estimate, Series
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.frames import FrameBuilder, StereoFrame
from gridslam.methods.stereo_bayes.pose import RobotPose
from gridslam.motion.absolute_pose_filter import PoseBelief

MAX_WAITING = 200  # largest number of images in the queue
SKIPPED_IMAGES = ("skipped.stereo.", "skipped.disparity.")
# By the reason for which images were skipped
ADVICE = {
    "no_calibration": "the log needs camera_info of both cameras, or focal length and baseline in its disparity messages",
    "no_motion": "disparity images need odometry",
    "narrower_than_disparities": "set method.disparity.disparities below the width of the pictures",
    "size": "the left and right pictures have different or tiny sizes",
    "no_pose": "the log has no odometry or absolute poses at the stamps of the images",
}
# After images of this duration without any odometry, visual odometry is used
WAIT_FOR_ODOMETRY_NS = 2_000_000_000


class PoseTrack:
    """Tracks the robot's pose with images in a queue until the motion up to their stamps is known.

    Subclasses decide how a frame is used and at which stamps poses are recorded.
    """

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        self._pose = RobotPose(config)
        self._frames = FrameBuilder(config)
        self._waiting: deque[StereoPair | Disparity] = deque()
        self._stamps: list[int] = []
        self._beliefs: list[PoseBelief] = []
        self._counters: Counter[str] = Counter()
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The last recorded pose."""
        if not self._beliefs:
            return None
        return Estimate(self._stamps[-1], self._beliefs[-1].pose)

    @property
    def timings_s(self) -> Mapping[str, float]:
        """Seconds spent in each stage so far."""
        return self._stopwatch.seconds

    def process(self, event: Event) -> None:
        """Odometry, absolute poses, stereo pairs or disparities, and the geometry of the head are used."""
        if isinstance(event, Odometry):
            self._pose.add_odometry(event)
            self._on_odometry(event.stamp_ns)
        elif isinstance(event, AbsolutePose):
            self._pose.add_absolute_pose(event)
        elif isinstance(event, CameraInfo):
            self._frames.add_info(event)
        elif isinstance(event, Transform):
            if event.is_static:
                self._frames.add_extrinsics(event)
        elif isinstance(event, StereoPair | Disparity):
            self._waiting.append(event)
            if len(self._waiting) > MAX_WAITING:
                self._skip(self._waiting.popleft(), "no_pose")
        self._process_waiting(is_last=False)

    def _finish(self) -> None:
        self._pose.start()
        self._process_waiting(is_last=True)
        while self._waiting:
            self._skip(self._waiting.popleft(), "no_pose")

    def _require_frames(self) -> None:
        """Raise MethodError if the log has images but none of them could be used."""
        skipped = {
            key.split(".")[2]: n
            for key, n in sorted(self._all_counters().items())
            if key.startswith(SKIPPED_IMAGES)
        }
        if self._stamps or not skipped:
            return
        reasons = ", ".join(f"{n} x {reason.replace('_', ' ')}" for reason, n in skipped.items())
        advice = next((text for reason, text in ADVICE.items() if reason in skipped), "see report.json")
        raise MethodError(f"no stereo pair or disparity image could be used ({reasons}): {advice}")

    def _on_odometry(self, stamp_ns: int) -> None:
        """Called after each odometry message."""

    def _use(self, frame: StereoFrame, belief: PoseBelief) -> None:
        """Called with each frame and the robot's pose at its stamp."""

    def _process_waiting(self, is_last: bool) -> None:
        """Use the images at whose stamps the motion is known; all of them if no more events follow (`is_last`)."""
        while self._waiting:
            image = self._waiting[0]
            if self._pose.is_visual is None:
                newest = self._waiting[-1].stamp_ns
                if not is_last and newest - image.stamp_ns < WAIT_FOR_ODOMETRY_NS:
                    return
                self._pose.is_visual = True
            if not self._pose.is_visual and not self._pose.is_known_at(image.stamp_ns) and not is_last:
                return
            self._waiting.popleft()
            frame = self._frame(image)
            if frame is None:
                continue
            if self._pose.is_visual:
                self._pose.add_step(frame.stamp_ns, frame.step)
                self._pose.start()
            belief = self._pose.at(frame.stamp_ns)
            if belief is None:
                self._skip(image, "no_pose")
                continue
            self._use(frame, belief)

    def _frame(self, image: StereoPair | Disparity) -> StereoFrame | None:
        with self._stopwatch.stage("disparity"):
            if isinstance(image, Disparity):
                if self._pose.is_visual:
                    self._skip(image, "no_motion")
                    return None
                return self._frames.of_disparity(image)
            return self._frames.of_pair(image, bool(self._pose.is_visual))

    def _record(self, stamp_ns: int, belief: PoseBelief) -> None:
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return
        self._stamps.append(stamp_ns)
        self._beliefs.append(belief)

    def _skip(self, image: StereoPair | Disparity, reason: str) -> None:
        kind = "stereo" if isinstance(image, StereoPair) else "disparity"
        self._counters[f"skipped.{kind}.{reason}"] += 1

    def _trajectory(self) -> Trajectory:
        if not self._stamps:
            return Trajectory.empty()
        return Trajectory(np.array(self._stamps, np.int64), np.array([b.pose for b in self._beliefs]))

    def _series(self) -> dict[str, Series]:
        stamps = np.array(self._stamps, np.int64)
        variances = np.array([np.diag(b.covariance) for b in self._beliefs]).reshape(-1, 3)
        return {
            "position_deviation": Series(stamps, np.sqrt(variances[:, 0] + variances[:, 1]), "m"),
            "heading_deviation": Series(stamps, np.degrees(np.sqrt(variances[:, 2])), "deg"),
        }

    def _all_counters(self) -> dict[str, int]:
        return dict(self._counters + self._frames.counters + self._pose.counters)
