"""Encodes events as ROS 2 messages in CDR."""

from __future__ import annotations

from collections.abc import Iterable

from gridslam.core.errors import LogError
from gridslam.core.messages import Event
from gridslam.core.stamps import END_NS
from gridslam.logs.encoding.cdr import check_text
from gridslam.logs.encoding.encoded import Encoded
from gridslam.logs.kind_lookup import kind_of_event


def encode(event: Event, topic: str | None = None) -> Iterable[Encoded]:
    """The messages of an event on `topic`, or on the default topic of its kind.

    A stereo pair and a reading of a ranger on a servo give two messages. Raises LogError: ROS cannot store the stamp or a name.
    """
    if not 0 <= event.stamp_ns < END_NS:
        raise LogError(
            f"stamp {event.stamp_ns} ns of a {type(event).__name__} cannot be written: ROS holds 0 to 2^31 s"
        )
    if topic is not None:
        check_text(topic.replace("\0", ""))  # MCAP keeps a topic with its length, not with a zero at its end
    to_ros = kind_of_event(event).to_ros
    assert to_ros is not None  # every kind with events has one
    return to_ros(event, topic)
