"""Looks up the kind of a message, by its class or the name of its schema, and the functions of the kind."""

from __future__ import annotations

from gridslam.core.messages import Event
from gridslam.logs.kinds import KINDS_IN_ORDER
from gridslam.logs.message_kind import FromFoxglove, FromRos, MessageKind
from gridslam.logs.skips import SkipReason

_OF_MESSAGE = {kind.message: kind for kind in KINDS_IN_ORDER if kind.message is not None}
_OF_ROS_TYPE = {name: kind for kind in KINDS_IN_ORDER for name in kind.ros}
_OF_FOXGLOVE_TYPE = {name: kind for kind in KINDS_IN_ORDER for name in kind.foxglove}


def kind_of_event(event: Event) -> MessageKind:
    """The kind of an event."""
    return _OF_MESSAGE[type(event)]


def kind_of_ros_type(name: str) -> str:
    """The kind of messages with a ROS type (`package/msg/Type`); `other` for unknown types."""
    kind = _OF_ROS_TYPE.get(name)
    return "other" if kind is None else kind.name


def kind_of_foxglove_type(name: str) -> str:
    """The kind of messages with a Foxglove type; empty for unknown types."""
    kind = _OF_FOXGLOVE_TYPE.get(name)
    return "" if kind is None else kind.name


def ros_converter(name: str) -> FromRos | None:
    """The function that converts decoded messages of a ROS type; None if `ros/decoder.py` converts them, or for unknown types."""
    kind = _OF_ROS_TYPE.get(name)
    return None if kind is None else kind.ros[name]


def foxglove_converter(name: str) -> FromFoxglove | None:
    """The function that converts decoded messages of a Foxglove type; None for unknown types."""
    kind = _OF_FOXGLOVE_TYPE.get(name)
    return None if kind is None else kind.foxglove[name]


def kinds_sharing(type_name: str) -> list[MessageKind]:
    """The kinds that may claim a stream with this ROS or Foxglove type, although the type belongs to another kind."""
    return [
        kind for kind in KINDS_IN_ORDER if type_name in kind.shared_ros or type_name in kind.shared_foxglove
    ]


def unusable_reason(event: Event) -> SkipReason | None:
    """The reason why no method can use the event; None if it can."""
    check = _UNUSABLE_REASONS.get(type(event))
    return check(event) if check else None


_UNUSABLE_REASONS = {
    kind.message: kind.unusable_reason
    for kind in KINDS_IN_ORDER
    if kind.message is not None and kind.unusable_reason is not None
}
