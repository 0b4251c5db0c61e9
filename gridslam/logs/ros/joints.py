"""Joints of a log's JointState messages and transforms: the wheels' angles, and the servos that turn rangers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from gridslam.core.messages import Transform, WheelTicks
from gridslam.logs.config import WheelsConfig
from gridslam.logs.rotations import yaw_of


class JointState(NamedTuple):
    """A sensor_msgs/JointState without speeds and efforts; `stamp_ns` is None where the message has no valid one."""

    stamp_ns: int | None
    frame_id: str
    names: Sequence[str]
    positions: Sequence[float]


class NoServoAngleError(ValueError):
    """A reading of a ranger whose servo has not been heard of yet."""


class Servos:
    """The last known angle of each servo: of the joint with the ranger's name, or of tf to its frame.

    `expected` are the joints and frames that the log tells of sooner or later: a ranger that is none of them does not turn.
    """

    def __init__(self, expected: Collection[str] = ()) -> None:
        self._expected = expected
        self._angles: dict[str, float] = {}

    def learn(self, joints: JointState) -> None:
        """Angles out of a message."""
        self._angles.update(zip(joints.names, joints.positions, strict=False))

    def turn(self, transform: Transform) -> None:
        """The angle of a frame that a transform turns."""
        self._angles[transform.child_frame_id] = yaw_of(transform.quat_wxyz)

    def bearing(self, frame: str) -> float:
        """The present angle (rad) of a ranger; 0 of one that does not turn. Raises NoServoAngleError before the first one."""
        angle = self._angles.get(frame)
        if angle is not None:
            return angle
        if frame in self._expected:
            raise NoServoAngleError(frame)
        return 0.0


def wheel_places(names: Sequence[str], config: WheelsConfig) -> tuple[int, int] | None:
    """Places of the left and right wheel among the joints; None where the message is not about wheels.

    Without a name in the config it is the first joint whose name has both `wheel` and the side in it.
    """

    def place(side: str, given: str | None) -> int | None:
        fits = (n == given if given else "wheel" in n.lower() and side in n.lower() for n in names)
        return next((i for i, fit in enumerate(fits) if fit), None)

    left, right = place("left", config.left), place("right", config.right)
    return None if left is None or right is None else (left, right)


def wheels_of(joints: JointState, config: WheelsConfig) -> WheelTicks:
    """The angles of a left and a right wheel. Raises ValueError where the message has none, or no valid stamp."""
    places = wheel_places(joints.names, config)
    if places is None or max(places) >= len(joints.positions):
        raise ValueError("no left and right wheel in it")
    if joints.stamp_ns is None:
        raise ValueError("bad stamp")
    return WheelTicks(
        joints.stamp_ns,
        joints.frame_id,
        float(joints.positions[places[0]]),
        float(joints.positions[places[1]]),
    )
