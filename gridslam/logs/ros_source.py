"""Logs of ROS messages, whatever container they lie in: raw messages in, streams and events out."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, Protocol

from gridslam.core.messages import Event, Transform
from gridslam.logs import foxglove, ros_events, ros_fast
from gridslam.logs.config import LogConfig
from gridslam.logs.ledger import Ledger
from gridslam.logs.mcap_file import Channel, Schema
from gridslam.logs.ros_types import KIND_OF_TYPE, decoder_of, full_name, is_standard
from gridslam.logs.rotations import normalise, yaw_of
from gridslam.logs.streams import RecordedStream, Skip, printable

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
    "sensor_msgs/msg/LaserScan": ros_fast.scan,
    "nav_msgs/msg/Odometry": ros_fast.odometry,
    "sensor_msgs/msg/Imu": ros_fast.imu,
}
_MOST_FRAMES = 1000
_MOST_EDGES = 10_000
_LITTLE = b"\x00\x01"


class Container(Protocol):
    """What a file format offers: channels, their schemas, and raw messages in recorded order, repeatably."""

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Complete after `messages` has been gone through once."""

    @property
    def schemas(self) -> Mapping[int, Schema]:
        """The same."""

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel id, data)."""


class _Decoder:
    """Messages of one channel: `head` reads stamp and frame only, `event` all of it. Both raise
    DECODING_ERRORS.
    """

    def __init__(self, channel: Channel, schema: Schema | None, config: LogConfig) -> None:
        self.topic = printable(channel.topic)
        self.type = printable(full_name(schema.name)) if schema else ""
        self.kind = KIND_OF_TYPE.get(self.type, "other")
        self.fault = ""
        self.stream: int | None = None
        self._config = config
        self._fast: Callable[[bytes], Event] | None = None
        self._standard_tf = False
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
            self._standard_tf = self.is_tf and is_standard(schema)
            if is_standard(schema):
                self._fast = _FAST.get(self.type)
            if self._fast is not None or self._standard_tf:
                self._decode = _Late(schema, self.type)
            else:
                try:
                    self._decode = decoder_of(schema, self.type)
                except ValueError:
                    self.fault = "unreadable_schema"
        self._convert = ros_events.CONVERTERS.get(self.type)

    @property
    def is_tf(self) -> bool:
        """Whether one message holds many transforms."""
        return self.kind == "tf"

    def classify(self, data: bytes) -> None:
        """Settle by its first message what a channel is whose type leaves it open."""
        if self.fault:
            return
        if self.type == "sensor_msgs/msg/Image" and ros_events.is_depth(self._decode(data)):
            self.kind, self._convert = "depth", ros_events.depth
        elif self.type == "sensor_msgs/msg/JointState":
            names = [str(n) for n in self._decode(data).name]
            if ros_events.wheel_names(names, self._config.wheels) is None:
                self.kind = "joints"
        elif self.is_json and self.kind != "other":
            self.kind = foxglove.kind_of_message(self.type, self.kind, self._decode(data))

    def head(self, data: bytes) -> tuple[int, str] | None:
        """(stamp_ns, frame) without decoding the rest; None without a valid stamp."""
        if not self.is_json:
            found = ros_fast.head(data)
            return None if found is None else (found[0], ros_fast.frame_text(found[1]))
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
        if self._standard_tf:
            return ros_fast.transforms(data, static)
        return ros_events.transforms(self._decode(data), static)

    def child_frame(self, data: bytes) -> str:
        """Of odometry."""
        event = self.event(data, None)
        return str(getattr(event, "child_frame_id", ""))

    def event(self, data: bytes, servos: _Servos | None) -> Event:
        """The whole message."""
        if self._fast is not None and data[:2] == _LITTLE:
            return self._fast(data)
        message = self._decode(data)
        if self.kind == "wheels":
            return ros_events.wheels(message, self._config.wheels)
        if self.kind == "range":
            _, frame = ros_events.head(message)
            return ros_events.reading(message, servos.bearing(frame) if servos else 0.0)
        if self.is_json and foxglove.kind_of(self.type):
            return foxglove.event(self.type, self.kind, message, self.topic)
        if self._convert is None:
            raise ValueError("no decoder")
        return self._convert(message, self.topic)

    def joints(self, data: bytes) -> dict[str, float]:
        """Angles by joint name."""
        message = self._decode(data)
        return {str(n): float(p) for n, p in zip(message.name, message.position, strict=False)}


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


class _Servos:
    """The last known angle of each servo: joints named as the ranger's frame, or tf with the frame as
    child.
    """

    def __init__(self) -> None:
        self._angles: dict[str, float] = {}

    def learn(self, angles: Mapping[str, float]) -> None:
        self._angles.update(angles)

    def turn(self, transform: Transform) -> None:
        self._angles[transform.child_frame_id] = yaw_of(transform.quat_wxyz)

    def bearing(self, frame: str) -> float:
        return self._angles.get(frame, 0.0)


class RosSource:
    """Streams of a container of ROS (or Foxglove JSON) messages."""

    order: Literal["recorded", "stamp"] = "recorded"
    base_frame: str | None = None

    def __init__(
        self,
        container: Container,
        files: list[Path],
        config: LogConfig,
        ledger: Ledger,
        name: str,
        compression: str = "",
    ) -> None:
        self.format = name
        self.compression = compression
        self.files = files
        self.ledger = ledger
        self.streams: list[RecordedStream] = []
        self._static: dict[str, Transform] = {}
        self._container = container
        self._config = config
        self._decoders: dict[int, _Decoder] = {}
        self._tf_streams: dict[tuple[str, str, str], int] = {}
        self._survey()

    @property
    def static_edges(self) -> list[Transform]:
        """The last static transform to each frame."""
        return list(self._static.values())

    def close(self) -> None:
        """Nothing stays open between passes."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Events in the file's order."""
        servos = _Servos()
        needs_servos = any(self.streams[i].kind == "range" for i in wanted)
        tf_wanted = any(self.streams[i].kind == "tf" for i in wanted)
        decoders = self._decoders
        for channel, data in self._container.messages():
            decoder = decoders.get(channel)
            if decoder is None:
                continue
            if decoder.is_tf:
                if tf_wanted or needs_servos:
                    yield from self._read_tf(decoder, data, wanted, servos)
                continue
            if needs_servos and decoder.kind in ("joints", "wheels"):
                with suppress(*DECODING_ERRORS):
                    servos.learn(decoder.joints(data))
            stream = decoder.stream
            if stream is None or stream not in wanted:
                continue
            if decoder.is_counted(data):
                yield stream, _event(decoder, data, servos)

    def _read_tf(
        self, decoder: _Decoder, data: bytes, wanted: frozenset[int], servos: _Servos
    ) -> Iterator[tuple[int, Event | Skip]]:
        try:
            found = decoder.transforms(data, False)
        except DECODING_ERRORS:
            return
        for transform in found:
            servos.turn(transform)
            stream = self._tf_streams.get((decoder.topic, transform.frame_id, transform.child_frame_id))
            if stream in wanted and stream is not None and transform.stamp_ns >= 0:
                yield stream, transform

    def _survey(self) -> None:
        """First pass: stamps and frames of every stream, static transforms, and what cannot be read."""
        seen: dict[int, int] = {}
        for channel, data in self._container.messages():
            seen[channel] = number = seen.get(channel, 0) + 1
            decoder = self._decoders.get(channel) or self._new_decoder(channel, data)
            if decoder is None:
                self.ledger.skip(
                    "unknown", "no_channel", f"{self.files[0].name} message {number} of channel {channel}"
                )
                continue
            if decoder.fault:
                self.ledger.skip(decoder.kind, decoder.fault, f"{decoder.topic} ({decoder.type})")
                continue
            try:
                if decoder.is_tf:
                    self._survey_tf(decoder, data, number)
                elif decoder.stream is not None:
                    self._survey_message(decoder, data, number)
            except DECODING_ERRORS:
                self.ledger.skip(decoder.kind, "undecodable", f"{decoder.topic} message {number}")

    def _survey_message(self, decoder: _Decoder, data: bytes, number: int) -> None:
        stream = self.streams[decoder.stream or 0]
        if stream.kind == "other":
            stream.stamps_ns.append(0)
            return
        head = decoder.head(data)
        if head is None:
            self.ledger.skip(decoder.kind, "bad_stamp", f"{decoder.topic} message {number}")
            return
        stamp, frame = head
        stream.stamps_ns.append(stamp)
        if frame not in stream.frames and len(stream.frames) < _MOST_FRAMES:
            stream.frames[frame] = None
        if stream.kind == "odom" and not stream.child_frame:
            with suppress(*DECODING_ERRORS):  # `read` counts it
                stream.child_frame = decoder.child_frame(data)

    def _survey_tf(self, decoder: _Decoder, data: bytes, number: int) -> None:
        static = decoder.topic.endswith("tf_static")
        for transform in decoder.transforms(data, static):
            if static:
                self._static[transform.child_frame_id] = transform
                continue
            if transform.stamp_ns < 0:
                self.ledger.skip("tf", "bad_stamp", f"{decoder.topic} message {number}")
                continue
            key = (decoder.topic, transform.frame_id, transform.child_frame_id)
            rotation = normalise(transform.quat_wxyz)
            value = None if rotation is None else (transform.translation_m, rotation)
            if key not in self._tf_streams and len(self._tf_streams) >= _MOST_EDGES:
                self.ledger.skip("tf", "too_many_frames", f"{decoder.topic} message {number}")
                continue
            if key not in self._tf_streams:
                self._tf_streams[key] = len(self.streams)
                detail = f"{transform.frame_id}->{transform.child_frame_id}"
                self.streams.append(
                    RecordedStream(
                        "tf",
                        decoder.topic,
                        decoder.type,
                        detail,
                        frames={transform.frame_id: None},
                        child_frame=transform.child_frame_id,
                        constant=value,
                    )
                )
            stream = self.streams[self._tf_streams[key]]
            stream.stamps_ns.append(transform.stamp_ns)
            if stream.constant != value:
                stream.constant = None

    def _new_decoder(self, identifier: int, first: bytes) -> _Decoder | None:
        channel = self._container.channels.get(identifier)
        if channel is None:
            return None
        schema = self._container.schemas.get(channel.schema_id)
        decoder = _Decoder(channel, schema, self._config)
        with suppress(*DECODING_ERRORS):  # the survey counts such a message; its type's usual kind holds
            decoder.classify(first)
        if not decoder.is_tf:
            decoder.stream = len(self.streams)
            self.streams.append(RecordedStream(decoder.kind, decoder.topic, decoder.type or channel.encoding))
        self._decoders[identifier] = decoder
        return decoder


def _event(decoder: _Decoder, data: bytes, servos: _Servos) -> Event | Skip:
    try:
        return decoder.event(data, servos)
    except DECODING_ERRORS as error:
        return Skip(_reason(error))


def _reason(error: Exception) -> str:
    """The reason under which an undecodable message is counted."""
    return "unknown_encoding" if str(error).startswith("encoding ") else "undecodable"
