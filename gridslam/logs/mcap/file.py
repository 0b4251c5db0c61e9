"""An MCAP file, read so that damage costs as few messages as possible.

Records lie in chunks, or bare. A chunk is used if it can be unpacked and its checksum is right. After bytes that are not a
record, reading continues at the next chunk, which the index names or a search finds.
"""

from __future__ import annotations

import zlib
from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from gridslam.core.errors import LogError
from gridslam.logs.mcap.definitions import Definitions
from gridslam.logs.mcap.records import (
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
    CHUNK_INDEX,
    DATA_END,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD_BYTES,
    MESSAGE_RECORD,
    RECORD,
    SCHEMA,
    SKIPPED_OPCODES,
    STATISTICS,
    block,
    exactly,
    is_chunk_body,
    profile_of,
    text,
    unpack,
    unpack_beginning,
)
from gridslam.logs.mcap.search import next_record
from gridslam.logs.mcap.summary import Summary, end_of_recording, read_summary
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Schema

_HEADER_BYTES = 100
# Of a chunk, or of all chunks of a file, that unpack to more than _ALWAYS_UNPACKED bytes; sensor data stay below 100
_MAX_EXPANSION = 1000
_ALWAYS_UNPACKED = 64 << 20
_MIN_MESSAGE_LIMIT = 10_000  # messages that any file may hold; a larger file one per byte
# Largest number of other records of one chunk, which should hold schemas, channels and messages only
_MAX_OTHER_RECORDS = 1000


@dataclass(slots=True)
class McapFile:
    """An MCAP file. `messages` reads it from start to end; the first time it counts the damage.

    The number of a channel or schema is its id in the file; one that is defined again with another content gets a number of
    its own, which the messages after that definition carry.
    """

    path: Path
    message_counts: MessageCounts
    limit_bytes: int
    compressions: dict[str, int] = field(default_factory=dict)
    _chunk_offsets: list[int] = field(default_factory=list)  # ascending
    _channels: Definitions[Channel] = field(default_factory=lambda: Definitions())
    _schemas: Definitions[Schema] = field(default_factory=lambda: Definitions())
    _bad_chunks: set[int] = field(default_factory=set)
    _resumed: dict[int, int] = field(default_factory=dict)
    _expected: int | None = None
    profile: str = ""
    span_ns: tuple[int, int] | None = None  # of the times of arrival, where the index says them
    _size: int = 0
    _unpacked: int = 0  # bytes of all chunks so far of a pass
    _is_indexed: bool = False
    _last: tuple[bytes, int] = b"", 0  # the data of the last message's record, and where its body begins
    _complete: bool = False

    def __post_init__(self) -> None:
        self._size = self.path.stat().st_size
        with self.path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise LogError(f"{self.path}: not an MCAP file (its first bytes are wrong)")
            self.profile = profile_of(stream.read(_HEADER_BYTES))
            summary = read_summary(stream, self._size, self.limit_bytes)
        self._complete = summary is not None
        if summary is not None:
            self._enter(summary)

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Channels by number."""
        return self._channels.by_number

    @property
    def schemas(self) -> Mapping[int, Schema]:
        """Schemas by number."""
        return self._schemas.by_number

    @property
    def arrival_ns(self) -> int | None:
        """The log time of the last message."""
        data, start = self._last
        return int.from_bytes(data[start + 6 : start + 14], "little", signed=True) if data else None

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel number, data) of every readable message in recorded order. The same messages on every call."""
        number = 0
        limit = max(self._size, _MIN_MESSAGE_LIMIT)
        self._unpacked = 0
        self._channels.present.clear()
        self._schemas.present.clear()
        for message in self._messages():
            number += 1
            if number > limit:
                self._lose("messages_beyond_one_per_byte", self._size)
                break
            yield message
        if not self._is_indexed and self._expected is not None and number < self._expected:
            missing = self._expected - number
            self.message_counts.note(f"{self.path.name}: {missing} of {self._expected} messages are missing")
        self._is_indexed = True

    def _messages(self) -> Iterator[tuple[int, bytes]]:
        with self.path.open("rb") as stream:
            stream.seek(len(MAGIC))
            at = len(MAGIC)
            while at + RECORD.size <= self._size:
                opcode, length = RECORD.unpack(exactly(stream, RECORD.size))
                body = at + RECORD.size
                if (
                    opcode == DATA_END
                    and length == 4
                    and (not self._chunk_offsets or self._chunk_offsets[-1] < at)
                ):
                    end = end_of_recording(stream, body + length, self._size)
                    if end < self._size:
                        self._lose("rest_after_the_end", end)
                    elif not self._complete:
                        self.message_counts.note(
                            f"{self.path.name}: the index at its end is missing; no message is"
                        )
                    break
                if opcode == CHUNK and body + length > self._size:
                    yield from self._records(self._cut_chunk(stream), at, is_cut=True)
                if body + length > self._size or not self._belongs_here(stream, opcode, length):
                    at = self._resume(stream, at)
                    continue
                if opcode == CHUNK:
                    yield from self._chunk(stream, at, length)
                elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                    if length > self.limit_bytes:
                        self._lose("too_large_record", at)
                    else:
                        yield from self._records(RECORD.pack(opcode, length) + exactly(stream, length), at)
                at = body + length
                stream.seek(at)
            else:
                self._note_end(at)

    def _belongs_here(self, stream: IO[bytes], opcode: int, length: int) -> bool:
        """Whether a record of this opcode can be at the stream's position in the data section.

        A chunk with a damaged opcode is not taken for a record to skip.
        """
        if opcode in (SCHEMA, CHANNEL, MESSAGE, CHUNK, HEADER):
            return True
        if opcode not in SKIPPED_OPCODES and opcode < 0x80:
            return False
        here = stream.tell()
        is_chunk = is_chunk_body(stream, length)
        stream.seek(here)
        return not is_chunk

    def _chunk(self, stream: IO[bytes], at: int, length: int) -> Iterator[tuple[int, bytes]]:
        if at in self._bad_chunks:
            return
        data = self._unpack(stream, at, length)
        if data is None:
            self._bad_chunks.add(at)
        else:
            yield from self._records(data, at)

    def _unpack(self, stream: IO[bytes], at: int, length: int) -> bytes | None:
        """The chunk's records; None, and counted, where it cannot be used."""
        data, fault = None, "chunk_of_impossible_size"
        if CHUNK_HEAD.size + 8 <= length <= self.limit_bytes:
            body = exactly(stream, length)
            _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(body)
            start = CHUNK_HEAD.size + name_length + 8
            packed_size = int.from_bytes(body[start - 8 : start], "little")
            is_bomb = size > max(_ALWAYS_UNPACKED, _MAX_EXPANSION * packed_size)
            is_bomb |= self._unpacked + size > max(_ALWAYS_UNPACKED, _MAX_EXPANSION * self._size)
            if start + packed_size <= length and size <= self.limit_bytes and not is_bomb:
                self._unpacked += size
                name = body[CHUNK_HEAD.size : start - 8].decode("utf-8", "replace")
                fault = "chunk_that_cannot_be_unpacked"
                data = unpack(name, body[start : start + packed_size], size)
                if data is not None and not self._is_indexed:
                    if crc and zlib.crc32(data) != crc:
                        data, fault = None, "chunk_with_wrong_checksum"
                    self.compressions[name or "none"] = self.compressions.get(name or "none", 0) + 1
        if data is None:
            self._lose(fault, at)
        return data

    def _cut_chunk(self, stream: IO[bytes]) -> bytes:
        """The records at the start of a chunk that the end of the file cuts; the stream is at its body."""
        after = bisect_right(self._chunk_offsets, stream.tell())
        if self._complete or after < len(self._chunk_offsets):
            return b""  # no cut, but damage
        return unpack_beginning(stream.read(self.limit_bytes), min(_ALWAYS_UNPACKED, self.limit_bytes))

    def _records(self, data: bytes, at: int, is_cut: bool = False) -> Iterator[tuple[int, bytes]]:
        """The messages among the records in `data`; schemas and channels are entered. `is_cut`: the last record may be cut."""
        position, end, others = 0, len(data), 0
        numbers = self._channels.present
        unpack_from = MESSAGE_RECORD.unpack_from
        while position + 11 <= end:
            opcode, length, channel = unpack_from(data, position)
            start = position + 9
            position = start + length
            if position > end:
                if not is_cut:
                    self._lose("rest_of_damaged_chunk", at)
                return
            if opcode == MESSAGE:
                if length < MESSAGE_HEAD_BYTES:
                    self._lose("rest_of_damaged_chunk", at)
                    return
                self._last = data, start
                yield (
                    numbers.get(channel, channel) if numbers else channel,
                    data[start + MESSAGE_HEAD_BYTES : position],
                )
            elif opcode == SCHEMA:
                self._note_schema(data[start:position], at)
            elif opcode == CHANNEL:
                self._note_channel(data[start:position], at)
            else:
                others += 1
                if opcode == 0 or others > _MAX_OTHER_RECORDS:
                    self._lose("rest_of_damaged_chunk", at)
                    return

    def _note_schema(self, body: bytes, at: int) -> None:
        try:
            identifier = int.from_bytes(body[:2], "little")
            name, after = text(body, 2)
            encoding, after = text(body, after)
            data, _ = block(body, after)
        except (ValueError, UnicodeDecodeError):
            self._lose("damaged_schema", at)
            return
        self._schemas.enter(identifier, Schema(name, encoding, data))

    def _note_channel(self, body: bytes, at: int) -> None:
        try:
            identifier = int.from_bytes(body[:2], "little")
            topic, after = text(body, 4)
            encoding, _ = text(body, after)
        except (ValueError, UnicodeDecodeError):
            self._lose("damaged_channel", at)
            return
        schema = self._schemas.number_of(int.from_bytes(body[2:4], "little"))
        if self._channels.enter(identifier, Channel(topic, encoding, schema)) and not self._is_indexed:
            self.message_counts.note(
                f"{self.path.name}: channel {identifier} is defined again as {topic}: its messages from there on count as "
                "another stream"
            )

    def _enter(self, summary: Summary) -> None:
        """Take in schemas, channels, the count of messages and the places of chunks."""
        for opcode, body in summary.records():
            if opcode == SCHEMA:
                self._note_schema(body, summary.start)
            elif opcode == CHANNEL:
                self._note_channel(body, summary.start)
            elif opcode == STATISTICS and len(body) >= 8:
                self._expected = int.from_bytes(body[:8], "little")
                if len(body) >= 42 and self._expected:
                    first, last = body[26:34], body[34:42]
                    self.span_ns = int.from_bytes(first, "little"), int.from_bytes(last, "little")
            elif opcode == CHUNK_INDEX and len(body) >= 24:
                self._chunk_offsets.append(int.from_bytes(body[16:24], "little"))
        self._chunk_offsets = sorted(offset for offset in self._chunk_offsets if offset < self._size)

    def _resume(self, stream: IO[bytes], at: int) -> int:
        """The place to continue after bytes at `at` that are not a record, the same on every pass.

        It is the next chunk of the index, else the next place that looks like a record.
        """
        if at in self._resumed:
            stream.seek(self._resumed[at])
            return self._resumed[at]
        stream.seek(at)
        chunked = bool(self.compressions or self._bad_chunks) or stream.read(1) == bytes([CHUNK])
        after = bisect_right(self._chunk_offsets, at)
        place = self._chunk_offsets[after] if after < len(self._chunk_offsets) else None
        if place is None:
            place = next_record(stream, at + 1, self._size, (CHUNK,) if chunked else (MESSAGE, CHUNK))
        self._lose("damaged_part" if place is not None or self._complete else "last_record_of_cut_file", at)
        self._resumed[at] = self._size if place is None else place
        stream.seek(self._resumed[at])
        return self._resumed[at]

    def _note_end(self, at: int) -> None:
        """The records ended without the mark of a complete file."""
        if not self._complete:
            self.message_counts.lose(
                "end_of_file", f"{self.path.name} byte {at} (cut, or the recorder was not stopped)"
            )

    def _lose(self, what: str, at: int) -> None:
        """Count damage, on the first pass only."""
        if not self._is_indexed:
            self.message_counts.lose(what, f"{self.path.name} byte {at}")
