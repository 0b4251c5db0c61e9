"""Messages of one channel to events: by hand where the type is frequent and standard, else by its schema."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from gridslam.core.messages import Event, Transform
from gridslam.logs.config import LogConfig
from gridslam.logs.ros import events, fast_cdr, foxglove
from gridslam.logs.ros.container import Channel, Schema
from gridslam.logs.ros.joints import JointState, Servos, wheel_places, wheels_of
from gridslam.logs.ros.types import KIND_OF_TYPE, decoder_of, full_name, is_standard
from gridslam.logs.streams import printable

# What decoding a damaged message may raise.
DECODING_ERRORS = (
    struct.error,
    ValueError,
    IndexError,
    KeyError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
)
_FAST: dict[str, Callable[[bytes], Event]] = {
    "sensor_msgs/msg/LaserScan": fast_cdr.scan,
    "nav_msgs/msg/Odometry": fast_cdr.odometry,
    "sensor_msgs/msg/Imu": fast_cdr.imu,
}
_LITTLE = b"\x00\x01"
_STILL = Servos()


class ChannelDecoder:
    """Messages of one channel: `head` reads stamp and frame only, `event` all; both raise DECODING_ERRORS."""

    def __init__(self, channel: Channel, schema: Schema | None, config: LogConfig) -> None:
        self.topic = printable(channel.topic)
        self.type = printable(full_name(schema.name)) if schema else ""
        self.kind = KIND_OF_TYPE.get(self.type, "other")
        self.fault = ""
        self.stream: int | None = None
        self._config = config
        self._fast: Callable[[bytes], Event] | None = None
        self._standard = False
        self.joint_names: tuple[str, ...] = ()  # in the first message, where it holds joints
        self._decode: Callable[[bytes], Any] = _no_decoder
        self.is_json = channel.encoding == "json"
        if self.is_json:
            foreign = foxglove.kind_of(schema.name if schema else "")
            if foreign:
                self.type, self.kind = (schema.name if schema else ""), foreign
            self._decode = foxglove.parse
        elif channel.encoding != "cdr":
            self.fault = "unknown_encoding" if self.kind != "other" else ""
        elif self.kind != "other" and schema is not None:
            self._standard = is_standard(schema)
            if self._standard:
                self._fast = _FAST.get(self.type)
            if self._standard:
                self._decode = _Late(schema, self.type)
            else:
                try:
                    self._decode = decoder_of(schema, self.type)
                except ValueError:
                    self.fault = "unreadable_schema"
        self._convert = events.CONVERTERS.get(self.type)

    @property
    def is_tf(self) -> bool:
        """Whether one message holds many transforms."""
        return self.kind == "tf"

    def classify(self, data: bytes) -> None:
        """Settle by its first message what a channel is whose type leaves it open."""
        if self.fault:
            return
        if self.type == "sensor_msgs/msg/Image" and events.is_depth(self._decode(data)):
            self.kind, self._convert = "depth", events.depth
        elif self.type == "sensor_msgs/msg/JointState":
            self.joint_names = tuple(self.joints(data).names)
            if wheel_places(self.joint_names, self._config.wheels) is None:
                self.kind = "joints"
        elif self.is_json and self.kind != "other":
            self.kind = foxglove.kind_of_message(self.type, self.kind, self._decode(data))

    def head(self, data: bytes) -> tuple[int, str] | None:
        """(stamp_ns, frame) without decoding the rest; None without a valid stamp."""
        if not self.is_json:
            found = fast_cdr.head(data)
            return None if found is None else (found[0], fast_cdr.frame_text(found[1]))
        stamp, frame = foxglove.head(self._decode(data))
        return None if stamp is None else (stamp, frame)

    def is_counted(self, data: bytes) -> bool:
        """Whether the survey has a stamp of this message."""
        try:
            return self.head(data) is not None
        except DECODING_ERRORS:
            return False

    def transforms(self, data: bytes, static: bool) -> list[Transform]:
        """All transforms of a tf message; those without a valid stamp have stamp -1."""
        if self.is_json:
            return foxglove.transforms(self._decode(data), static)
        if self._standard:
            return fast_cdr.transforms(data, static)
        return events.transforms(self._decode(data), static)

    def child_frame(self, data: bytes) -> str:
        """Of odometry."""
        event = self.event(data, None)
        return str(getattr(event, "child_frame_id", ""))

    def event(self, data: bytes, servos: Servos | None) -> Event:
        """The whole message."""
        is_little = data[:2] == _LITTLE
        if self._fast is not None and is_little:
            return self._fast(data)
        if self.kind == "wheels":
            return wheels_of(self.joints(data), self._config.wheels)
        if self.kind == "range":
            bearing_of = (servos or _STILL).bearing
            if self._standard and is_little:
                return fast_cdr.reading(data, bearing_of)
            return events.reading(self._decode(data), bearing_of)
        message = self._decode(data)
        if self.is_json and foxglove.kind_of(self.type):
            return foxglove.event(self.type, self.kind, message, self.topic)
        if self._convert is None:
            raise ValueError("no decoder")
        return self._convert(message, self.topic)

    def joints(self, data: bytes) -> JointState:
        """Angles by joint name."""
        if self._standard and data[:2] == _LITTLE:
            return fast_cdr.joints(data)
        return events.joints(self._decode(data))


class _Late:
    """A general decoder that is made when it is needed: for the odd message the fast way cannot read."""

    def __init__(self, schema: Schema, name: str) -> None:
        self._schema = schema
        self._name = name
        self._decode: Callable[[bytes], Any] | None = None

    def __call__(self, data: bytes) -> Any:
        if self._decode is None:
            self._decode = decoder_of(self._schema, self._name)
        return self._decode(data)


def _no_decoder(data: bytes) -> Any:
    raise ValueError("no decoder")
