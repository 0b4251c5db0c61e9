"""Decodes the messages of one channel: frequent standard types with hand-written decoders, others by their schema."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from gridslam.core.messages import Event, Transform
from gridslam.logs.codecs import ranger, transform
from gridslam.logs.config import LogConfig
from gridslam.logs.kind_lookup import (
    foxglove_converter,
    kind_of_foxglove_type,
    kind_of_ros_type,
    kinds_sharing,
    ros_converter,
)
from gridslam.logs.kinds import KINDS
from gridslam.logs.message_kind import FromFoxglove
from gridslam.logs.ros import fast_cdr, foxglove, protobuf
from gridslam.logs.ros.container import Channel, Schema
from gridslam.logs.ros.joints import JointState, Servos, joint_state, wheel_places, wheels_of
from gridslam.logs.ros.types import decoder_of, full_name, is_standard
from gridslam.logs.skips import SkipReason

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
_JOINTS, _RANGE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Range"  # are decoded with their context
_LITTLE = b"\x00\x01"
_NO_SERVOS = Servos()


class ChannelDecoder:
    """Decodes the messages of one channel; its methods raise DECODING_ERRORS for damaged ones.

    `kind` is the kind of the channel's messages, `stream` the index of their stream. `unusable_reason` is the reason why none of
    them can be decoded. `joint_names` are those of the first message, if it holds joints. `may_read` returns whether a definition
    may be read, because that takes time.
    """

    def __init__(
        self,
        channel: Channel,
        schema: Schema | None,
        config: LogConfig,
        may_read: Callable[[Schema], bool] = lambda definition: True,
    ) -> None:
        self.topic = channel.topic
        self.type = full_name(schema.name) if schema else ""
        self.kind = kind_of_ros_type(self.type)
        self.unusable_reason: SkipReason | None = None
        self.stream: int | None = None
        self.joint_names: tuple[str, ...] = ()
        self.is_json = channel.encoding in ("json", "protobuf")  # protobuf becomes objects like those of JSON
        self._config = config
        self._fast: Callable[[bytes], Event] | None = None
        self._is_standard = False
        self._decode: Callable[[bytes], Any] = _no_decoder
        if self.is_json:
            self._use_json(schema)
        elif channel.encoding != "cdr":
            self.unusable_reason = SkipReason.UNKNOWN_ENCODING if self.kind != "other" else None
        elif self.kind != "other" and schema is not None:
            self._use_schema(schema, may_read)
        if channel.encoding == "protobuf" and self.kind != "other":
            self._use_protobuf(schema, may_read)
        self._convert = ros_converter(self.type)
        self._convert_foxglove: FromFoxglove | None = foxglove_converter(self.type)
        self._with_context = {_JOINTS: self._wheels, _RANGE: self._reading}.get(self.type)

    def _use_json(self, schema: Schema | None) -> None:
        name = schema.name if schema else ""
        foxglove_kind = kind_of_foxglove_type(name)
        if foxglove_kind:
            self.type, self.kind = name, foxglove_kind
        self._decode = foxglove.parse

    def _use_protobuf(self, schema: Schema | None, may_read: Callable[[Schema], bool]) -> None:
        self.unusable_reason = SkipReason.UNREADABLE_SCHEMA
        if schema is not None and may_read(schema):
            with suppress(*DECODING_ERRORS):
                self._decode = protobuf.decoder_of(schema.data, schema.name)
                self.unusable_reason = None

    def _use_schema(self, schema: Schema, may_read: Callable[[Schema], bool]) -> None:
        self._is_standard = may_read(schema) and is_standard(schema)
        if self._is_standard:
            self._fast = _FAST.get(self.type)
            self._decode = _LazyDecoder(schema, self.type)
            return
        self.unusable_reason = SkipReason.UNREADABLE_SCHEMA
        if may_read(schema):
            with suppress(ValueError):
                self._decode = decoder_of(schema, self.type)
                self.unusable_reason = None

    @property
    def is_tf(self) -> bool:
        """Whether one message holds many transforms."""
        return KINDS[self.kind].message is Transform

    def classify(self, data: bytes) -> None:
        """Determine the kind by the first message, if the type does not."""
        if self.unusable_reason:
            return
        if self.type == _JOINTS:
            self.joint_names = tuple(self.joints(data).names)
            if wheel_places(self.joint_names, self._config.wheels) is None:
                self.kind, self._with_context = "joints", None
        for kind in kinds_sharing(self.type):
            if kind.claims is not None and kind.claims(self._decode(data), self.topic):
                self.kind = kind.name
                self._convert = kind.shared_ros.get(self.type, self._convert)
                self._convert_foxglove = kind.shared_foxglove.get(self.type, self._convert_foxglove)

    def head(self, data: bytes) -> tuple[int, str] | None:
        """(stamp_ns, frame) without decoding the rest; None without a valid stamp."""
        if not self.is_json:
            found = fast_cdr.head(data)
            return None if found is None else (found[0], fast_cdr.frame_text(found[1]))
        stamp, frame = foxglove.head(self._decode(data))
        return None if stamp is None else (stamp, frame)

    def transforms(self, data: bytes, is_static: bool) -> list[Transform]:
        """All transforms of a tf message; an invalid stamp becomes INVALID_STAMP_NS."""
        if self.is_json:
            return foxglove.transforms(self._decode(data), is_static)
        if self._is_standard:
            return fast_cdr.transforms(data, is_static)
        return transform.from_ros(self._decode(data), is_static)

    def child_frame(self, data: bytes) -> str:
        """The child frame of an odometry message."""
        return str(getattr(self.event(data, None), "child_frame_id", ""))

    def event(self, data: bytes, servos: Servos | None) -> Event:
        """The event of a message; `servos` gives the bearing of a ranger's reading."""
        is_little = data[:2] == _LITTLE
        if self._fast is not None and is_little:
            return self._fast(data)
        if self._with_context is not None:
            return self._with_context(data, servos or _NO_SERVOS)
        message = self._decode(data)
        if self.is_json and kind_of_foxglove_type(self.type):
            return foxglove.event(self._convert_foxglove, message, self.topic)
        if self._convert is None:
            raise ValueError("no conversion")
        return self._convert(message, self.topic)

    def _wheels(self, data: bytes, _: Servos) -> Event:
        """The wheel angles of a JointState message."""
        return wheels_of(self.joints(data), self._config.wheels)

    def _reading(self, data: bytes, servos: Servos) -> Event:
        """A ranger's reading, with the current bearing of its servo."""
        if self._is_standard and data[:2] == _LITTLE:
            return fast_cdr.reading(data, servos.bearing)
        return ranger.from_ros(self._decode(data), servos.bearing)

    def joints(self, data: bytes) -> JointState:
        """The joints of a JointState message."""
        if self._is_standard and data[:2] == _LITTLE:
            return fast_cdr.joints(data)
        return joint_state(self._decode(data))


class _LazyDecoder:
    """A general decoder, made for the first message that the hand-written one cannot read."""

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
