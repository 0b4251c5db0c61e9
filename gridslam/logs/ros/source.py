"""Logs of ROS messages, whatever container they lie in: raw messages in, streams and events out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Literal

from gridslam.core.messages import Event, Transform
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Container
from gridslam.logs.ros.decoder import DECODING_ERRORS, ChannelDecoder
from gridslam.logs.ros.joints import NoServoAngleError, Servos
from gridslam.logs.rotations import normalise
from gridslam.logs.streams import RecordedStream, Skip, printable

_MOST_FRAMES = 1000
_MOST_EDGES = 10_000


class RosSource:
    """Streams of a container of ROS (or Foxglove JSON) messages."""

    order: Literal["recorded", "stamp"] = "recorded"
    base_frame: str | None = None

    def __init__(
        self,
        container: Container,
        files: list[Path],
        config: LogConfig,
        message_counts: MessageCounts,
        name: str,
        compression: str = "",
    ) -> None:
        self.format = name
        self.compression = compression
        self.files = files
        self.message_counts = message_counts
        self.streams: list[RecordedStream] = []
        self._static: dict[str, Transform] = {}
        self._container = container
        self._config = config
        self._decoders: dict[int, ChannelDecoder] = {}
        self._tf_streams: dict[tuple[str, str, str], int] = {}
        self._survey()
        self._servos = self._servo_names()
        self._note_servos_of_no_ranger()

    @property
    def static_edges(self) -> list[Transform]:
        """The last static transform to each frame."""
        return list(self._static.values())

    def close(self) -> None:
        """Nothing stays open between passes."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Events in the file's order."""
        servos = Servos(self._servos)
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
        self, decoder: ChannelDecoder, data: bytes, wanted: frozenset[int], servos: Servos
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

    def _servo_names(self) -> frozenset[str]:
        """Joints and moving frames: what may turn a ranger."""
        joints = (decoder.joint_names for decoder in self._decoders.values())
        frames = (child for _, _, child in self._tf_streams)
        return frozenset(chain(chain.from_iterable(joints), frames))

    def _note_servos_of_no_ranger(self) -> None:
        """A ranger looks straight ahead where nothing turns it: said where there are servos that turn no ranger."""
        rangers = sorted({frame for s in self.streams if s.kind == "range" for frame in s.frames})
        servos = sorted(
            {printable(n) for d in self._decoders.values() if d.kind == "joints" for n in d.joint_names}
        )
        still = [frame for frame in rangers if frame not in self._servos]
        idle = [name for name in servos if name not in rangers]
        if still and idle:
            self.message_counts.note(
                f"{self.files[0].name}: no joint or tf turns the rangers {', '.join(still)}: they count as fixed, looking "
                f"straight ahead; a servo is found by its ranger's frame, and the joints {', '.join(idle)} have no ranger"
            )

    def _survey(self) -> None:
        """First pass: stamps and frames of every stream, static transforms, and what cannot be read."""
        seen: dict[int, int] = {}
        for channel, data in self._container.messages():
            seen[channel] = number = seen.get(channel, 0) + 1
            decoder = self._decoders.get(channel) or self._new_decoder(channel, data)
            if decoder is None:
                self.message_counts.skip(
                    "unknown", "no_channel", f"{self.files[0].name} message {number} of channel {channel}"
                )
                continue
            if decoder.fault:
                self.message_counts.skip(decoder.kind, decoder.fault, f"{decoder.topic} ({decoder.type})")
                continue
            try:
                if decoder.is_tf:
                    self._survey_tf(decoder, data, number)
                elif decoder.stream is not None:
                    self._survey_message(decoder, data, number)
            except DECODING_ERRORS:
                self.message_counts.skip(decoder.kind, "undecodable", f"{decoder.topic} message {number}")

    def _survey_message(self, decoder: ChannelDecoder, data: bytes, number: int) -> None:
        stream = self.streams[decoder.stream or 0]
        if stream.kind == "other":
            stream.stamps_ns.append(0)
            return
        head = decoder.head(data)
        if head is None:
            self.message_counts.skip(decoder.kind, "bad_stamp", f"{decoder.topic} message {number}")
            return
        stamp, frame = head
        stream.stamps_ns.append(stamp)
        if frame not in stream.frames and len(stream.frames) < _MOST_FRAMES:
            stream.frames[frame] = None
        if stream.kind == "odom" and not stream.child_frame:
            with suppress(*DECODING_ERRORS):  # `read` counts it
                stream.child_frame = decoder.child_frame(data)

    def _survey_tf(self, decoder: ChannelDecoder, data: bytes, number: int) -> None:
        static = decoder.topic.endswith("tf_static")
        for transform in decoder.transforms(data, static):
            if static:
                self._static[transform.child_frame_id] = transform
                continue
            if transform.stamp_ns < 0:
                self.message_counts.skip("tf", "bad_stamp", f"{decoder.topic} message {number}")
                continue
            key = (decoder.topic, transform.frame_id, transform.child_frame_id)
            rotation = normalise(transform.quat_wxyz)
            value = None if rotation is None else (transform.translation_m, rotation)
            if key not in self._tf_streams and len(self._tf_streams) >= _MOST_EDGES:
                self.message_counts.skip("tf", "too_many_frames", f"{decoder.topic} message {number}")
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

    def _new_decoder(self, identifier: int, first: bytes) -> ChannelDecoder | None:
        channel = self._container.channels.get(identifier)
        if channel is None:
            return None
        schema = self._container.schemas.get(channel.schema_id)
        decoder = ChannelDecoder(channel, schema, self._config)
        with suppress(*DECODING_ERRORS):  # the survey counts such a message; its type's usual kind holds
            decoder.classify(first)
        if not decoder.is_tf:
            decoder.stream = self._stream_of(decoder.kind, decoder.topic, decoder.type or channel.encoding)
        self._decoders[identifier] = decoder
        return decoder

    def _stream_of(self, kind: str, topic: str, type_name: str) -> int:
        """The stream of a channel; channels of one topic and type (several recorders' parts) share theirs."""
        key = (kind, topic, type_name)
        for index, stream in enumerate(self.streams):
            if (stream.kind, stream.topic, stream.type) == key:
                return index
        self.streams.append(RecordedStream(*key))
        return len(self.streams) - 1


def _event(decoder: ChannelDecoder, data: bytes, servos: Servos) -> Event | Skip:
    try:
        return decoder.event(data, servos)
    except DECODING_ERRORS as error:
        return Skip(_reason(error))


def _reason(error: Exception) -> str:
    """The reason under which an undecodable message is counted."""
    if isinstance(error, NoServoAngleError):
        return "no_servo_angle"
    return "unknown_encoding" if str(error).startswith("encoding ") else "undecodable"
