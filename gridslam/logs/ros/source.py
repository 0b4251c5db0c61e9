"""Streams and events of ROS messages in any container."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Literal

from gridslam.core.messages import Event, Transform
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Container, Schema
from gridslam.logs.ros.decoder import DECODING_ERRORS, ChannelDecoder
from gridslam.logs.ros.joints import Servos
from gridslam.logs.ros.types import MAX_DEFINITIONS
from gridslam.logs.rotations import is_same, normalise
from gridslam.logs.skips import Skip, SkipReason, UnusableMessageError
from gridslam.logs.streams import RecordedStream

_MAX_FRAMES = 1000
_MAX_EDGES = 10_000
_SKIPPED, _TRANSFORMS = -1, -2  # entries of the assignment for messages without a single stream


class RosSource:
    """Streams of a container of ROS (or Foxglove JSON) messages.

    The index pass assigns every message of the container to a stream, or skips and counts it. The reading pass
    follows this assignment message by message, so that both passes agree. `kept` is an object on which the container depends,
    and which must live as long as the source.
    """

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
        kept: object = None,
    ) -> None:
        self._kept = kept
        self.format = name
        self.compression = compression
        self.files = files
        self.message_counts = message_counts
        self.streams: list[RecordedStream] = []
        self._static: dict[str, list[Transform]] = {}  # by child: of each the first and the last that differs
        self._container = container
        self._config = config
        self._decoders: dict[int, ChannelDecoder] = {}
        self._definitions: set[Schema] = set()  # that decoders have read
        # Of streams but those of tf, by kind, topic and type
        self._numbers: dict[tuple[str, str, str], int] = {}
        self._tf_streams: dict[tuple[str, str, str], int] = {}
        self._assignment = array("i")  # per message of the container: its stream, _SKIPPED or _TRANSFORMS
        self._index()
        self._servos = self._servo_names()
        self._note_unused_servos()

    @property
    def static_edges(self) -> list[Transform]:
        """The last static transform to each frame, and before it the first one if it differs."""
        return list(chain.from_iterable(self._static.values()))

    @property
    def message_count(self) -> int:
        """Number of messages of the container, including skipped ones."""
        return len(self._assignment)

    def close(self) -> None:
        """Do nothing: no file stays open between passes."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Events in the file's order."""
        servos = Servos(self._servos)
        needs_servos = any(self.streams[i].kind == "range" for i in wanted)
        needs_tf = needs_servos or any(self.streams[i].kind == "tf" for i in wanted)
        servo_streams = {
            i for i, s in enumerate(self.streams) if needs_servos and s.kind in ("joints", "wheels")
        }
        decoders = self._decoders
        for stream, (channel, data) in zip(self._assignment, self._container.messages(), strict=False):
            if stream == _SKIPPED:
                continue
            if stream == _TRANSFORMS:
                if needs_tf:
                    yield from self._read_tf(decoders[channel], data, wanted, servos)
                continue
            if stream in servo_streams:
                with suppress(*DECODING_ERRORS):
                    servos.update_joints(decoders[channel].joints(data))
            if stream in wanted:
                yield stream, _event(decoders[channel], data, servos)

    def _read_tf(
        self, decoder: ChannelDecoder, data: bytes, wanted: frozenset[int], servos: Servos
    ) -> Iterator[tuple[int, Event | Skip]]:
        try:
            found = decoder.transforms(data, False)
        except DECODING_ERRORS:  # the file has changed since it was indexed
            return
        for transform in found:
            servos.update_transform(transform)
            stream = self._tf_streams.get((decoder.topic, transform.frame_id, transform.child_frame_id))
            if stream is not None and stream in wanted and transform.stamp_ns >= 0:
                yield stream, transform

    def _servo_names(self) -> frozenset[str]:
        """Names of joints and moving frames, which may be servos of rangers."""
        joints = (decoder.joint_names for decoder in self._decoders.values())
        frames = (child for _, _, child in self._tf_streams)
        return frozenset(chain(chain.from_iterable(joints), frames))

    def _note_unused_servos(self) -> None:
        """Note rangers without a servo, if the log has servos without a ranger."""
        rangers = dict.fromkeys(sorted({f for s in self.streams if s.kind == "range" for f in s.frames}))
        servos = sorted({n for d in self._decoders.values() if d.kind == "joints" for n in d.joint_names})
        fixed = [frame for frame in rangers if frame not in self._servos]
        unused = [name for name in servos if name not in rangers]
        if fixed and unused:
            self.message_counts.note(
                f"{self.files[0].name}: no joint or tf turns the rangers {', '.join(fixed)}: they count as fixed, "
                f"looking straight ahead; a servo is found by its ranger's frame, and the joints {', '.join(unused)} "
                "have no ranger"
            )

    def _index(self) -> None:
        """The index pass: enter stamps and frames of all streams and static transforms, and count unreadable messages."""
        numbers: dict[int, int] = {}
        for channel, data in self._container.messages():
            numbers[channel] = number = numbers.get(channel, 0) + 1
            self._assignment.append(self._index_one(channel, data, number))

    def _index_one(self, channel: int, data: bytes, number: int) -> int:
        """Enter one message, the `number`-th of its channel; its entry in the assignment."""
        decoder = self._decoders.get(channel) or self._new_decoder(channel, data)
        if decoder is None:
            where = f"{self.files[0].name} message {number} of channel {channel}"
            self.message_counts.skip("unknown", SkipReason.NO_CHANNEL.value, where)
            return _SKIPPED
        if decoder.unusable_reason:
            where = f"{decoder.topic} ({decoder.type})"
            self.message_counts.skip(decoder.kind, decoder.unusable_reason.value, where)
            return _SKIPPED
        try:
            if decoder.is_tf:
                return self._index_tf(decoder, data, number)
            return self._index_message(decoder, data, number)
        except DECODING_ERRORS:
            self._skip(decoder, SkipReason.UNDECODABLE, number)
            return _SKIPPED

    def _index_message(self, decoder: ChannelDecoder, data: bytes, number: int) -> int:
        index = decoder.stream
        assert index is not None
        stream = self.streams[index]
        if stream.kind == "other":
            stream.stamps_ns.append(0)
            return index
        head = decoder.head(data)
        if head is None:
            self._skip(decoder, SkipReason.BAD_STAMP, number)
            return _SKIPPED
        stamp, frame = head
        stream.stamps_ns.append(stamp)
        self._note_arrival(stream)
        if frame not in stream.frames and len(stream.frames) < _MAX_FRAMES:
            stream.frames[frame] = None
        if stream.kind == "odom" and not stream.child_frame:
            with suppress(*DECODING_ERRORS):  # the reading pass counts it
                stream.child_frame = decoder.child_frame(data)
        return index

    def _index_tf(self, decoder: ChannelDecoder, data: bytes, number: int) -> int:
        is_static = decoder.topic.endswith("tf_static")
        for transform in decoder.transforms(data, is_static):
            if is_static:
                self._index_static(transform)
            elif transform.stamp_ns < 0:
                self._skip(decoder, SkipReason.BAD_STAMP, number)
            else:
                self._index_moving(decoder, transform, number)
        return _SKIPPED if is_static else _TRANSFORMS

    def _index_static(self, transform: Transform) -> None:
        """Keep a static transform: of several to one child the first, and the last that differs from it."""
        known = self._static.setdefault(transform.child_frame_id, [])
        if known and _says_the_same(known[0], transform):
            known[0] = transform
        else:
            known[1 if known else 0 :] = [transform]

    def _index_moving(self, decoder: ChannelDecoder, transform: Transform, number: int) -> None:
        """Enter a transform of /tf into the stream of its two frames."""
        key = (decoder.topic, transform.frame_id, transform.child_frame_id)
        rotation = normalise(transform.quat_wxyz)
        value = None if rotation is None else (transform.translation_m, rotation)
        if key not in self._tf_streams:
            if len(self._tf_streams) >= _MAX_EDGES:
                self._skip(decoder, SkipReason.TOO_MANY_FRAMES, number)
                return
            self._tf_streams[key] = len(self.streams)
            self.streams.append(
                RecordedStream(
                    "tf",
                    decoder.topic,
                    decoder.type,
                    detail=f"{transform.frame_id}->{transform.child_frame_id}",
                    frames={transform.frame_id: None},
                    child_frame=transform.child_frame_id,
                    constant=value,
                )
            )
        stream = self.streams[self._tf_streams[key]]
        stream.stamps_ns.append(transform.stamp_ns)
        self._note_arrival(stream)
        if stream.constant is not None and (value is None or not is_same(stream.constant, value)):
            stream.constant = None

    def _note_arrival(self, stream: RecordedStream) -> None:
        """Enter the time of arrival of the last message."""
        arrival = self._container.arrival_ns
        if arrival is not None and -(2**63) <= arrival < 2**63:
            stream.arrivals_ns.append(arrival)

    def _skip(self, decoder: ChannelDecoder, reason: SkipReason, number: int) -> None:
        self.message_counts.skip(decoder.kind, reason.value, f"{decoder.topic} message {number}")

    def _new_decoder(self, identifier: int, first: bytes) -> ChannelDecoder | None:
        channel = self._container.channels.get(identifier)
        if channel is None:
            return None
        schema = self._container.schemas.get(channel.schema_id)
        decoder = ChannelDecoder(channel, schema, self._config, self._may_read)
        with suppress(*DECODING_ERRORS):  # the index pass counts the message; its type's usual kind holds
            decoder.classify(first)
        if not decoder.is_tf:
            decoder.stream = self._stream_of(decoder.kind, decoder.topic, decoder.type or channel.encoding)
        self._decoders[identifier] = decoder
        return decoder

    def _may_read(self, definition: Schema) -> bool:
        """Whether a definition is one of the first MAX_DEFINITIONS that the decoders of this log need."""
        if len(self._definitions) < MAX_DEFINITIONS:
            self._definitions.add(definition)
        return definition in self._definitions

    def _stream_of(self, kind: str, topic: str, type_name: str) -> int:
        """The stream of a channel; channels of one topic and type (parts of one recording) share a stream."""
        key = (kind, topic, type_name)
        if key not in self._numbers:
            self._numbers[key] = len(self.streams)
            self.streams.append(RecordedStream(*key))
        return self._numbers[key]


def _says_the_same(a: Transform, b: Transform) -> bool:
    """Whether two transforms to one child have the same parent, and poses that differ only by noise."""
    one, other = normalise(a.quat_wxyz), normalise(b.quat_wxyz)
    if a.frame_id != b.frame_id or one is None or other is None:
        return a.frame_id == b.frame_id and one is other
    return is_same((a.translation_m, one), (b.translation_m, other))


def _event(decoder: ChannelDecoder, data: bytes, servos: Servos) -> Event | Skip:
    try:
        return decoder.event(data, servos)
    except UnusableMessageError as error:
        return Skip(error.reason, detail=error.detail)
    except DECODING_ERRORS:
        return Skip(SkipReason.UNDECODABLE)
