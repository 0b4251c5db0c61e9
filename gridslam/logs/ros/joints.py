"""Joints of a log's JointState messages and transforms: the wheels' angles, and the servos that turn rangers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from gridslam.core.messages import Transform, WheelTicks
from gridslam.logs.config import WheelsConfig
from gridslam.logs.encoding.ros_fields import head, plain_name
from gridslam.logs.rotations import yaw_of
from gridslam.logs.skips import SkipReason, UnusableMessageError


class JointState(NamedTuple):
    """A sensor_msgs/JointState without speeds and efforts; `stamp_ns` is None if the message has no valid one."""

    stamp_ns: int | None
    frame_id: str
    names: Sequence[str]
    positions: Sequence[float]


def joint_state(message: Any) -> JointState:
    """The joints of a decoded sensor_msgs/JointState."""
    stamp_ns, frame = head(message)
    positions = np.asarray(message.position, np.float64).tolist()
    return JointState(stamp_ns, frame, [plain_name(joint) for joint in message.name], positions)


class Servos:
    """The last known angle of each servo, from the joint with the ranger's name or from tf to its frame.

    `expected` are the joints and moving frames of the whole log: a ranger that is none of them is fixed.
    """

    def __init__(self, expected: Collection[str] = ()) -> None:
        self._expected = expected
        self._angles: dict[str, float] = {}

    def update_joints(self, joints: JointState) -> None:
        """Enter the angles of a message."""
        self._angles.update(zip(joints.names, joints.positions, strict=False))

    def update_transform(self, transform: Transform) -> None:
        """Enter the yaw of a transform as the angle of its child frame."""
        self._angles[transform.child_frame_id] = yaw_of(transform.quat_wxyz)

    def bearing(self, frame: str) -> float:
        """The current angle (rad) of a ranger; 0 for a fixed one.

        Raises UnusableMessageError: the angle of its servo is not known yet.
        """
        angle = self._angles.get(frame)
        if angle is not None:
            return angle
        if frame in self._expected:
            raise UnusableMessageError(SkipReason.NO_SERVO_ANGLE)
        return 0.0


def wheel_places(names: Sequence[str], config: WheelsConfig) -> tuple[int, int] | None:
    """Indices of the left and right wheel among the joints; None if the joints are not wheels.

    Without a name in the config, a side's wheel is the first joint whose name contains `wheel` and the side.
    """
    left, right = _wheel_place(names, "left", config.left), _wheel_place(names, "right", config.right)
    return None if left is None or right is None else (left, right)


def _wheel_place(names: Sequence[str], side: str, configured: str | None) -> int | None:
    for place, name in enumerate(names):
        lowered = name.lower()
        if name == configured if configured else "wheel" in lowered and side in lowered:
            return place
    return None


def wheels_of(joints: JointState, config: WheelsConfig) -> WheelTicks:
    """The angles of the left and right wheel.

    Raises ValueError: the message has no such wheels; UnusableMessageError: its stamp is invalid.
    """
    places = wheel_places(joints.names, config)
    if places is None or max(places) >= len(joints.positions):
        raise ValueError("no left and right wheel in it")
    if joints.stamp_ns is None:
        raise UnusableMessageError(SkipReason.BAD_STAMP)
    return WheelTicks(
        joints.stamp_ns,
        joints.frame_id,
        left_rad=float(joints.positions[places[0]]),
        right_rad=float(joints.positions[places[1]]),
    )
