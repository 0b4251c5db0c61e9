"""An MCAP file, read so that damage costs as few messages as possible.

Records lie in chunks, or bare. A chunk is used if it can be unpacked and its checksum is right. After bytes that are not a
record, reading continues at the next chunk, which the index names or a search finds.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from gridslam.core.errors import LogError
from gridslam.logs.mcap.chunks import ChunkUnpacker, is_chunk_body
from gridslam.logs.mcap.damage import Damage
from gridslam.logs.mcap.record_reader import RecordReader
from gridslam.logs.mcap.records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    HEADER,
    MAGIC,
    MESSAGE,
    RECORD,
    SCHEMA,
    SKIPPED_OPCODES,
    exactly,
    profile_of,
)
from gridslam.logs.mcap.search import next_record
from gridslam.logs.mcap.summary import Summary, end_of_recording, read_summary
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Schema

_HEADER_BYTES = 100
_MIN_MESSAGE_LIMIT = 10_000  # number of messages that any file may hold; a larger file may hold one per byte


@dataclass(slots=True)
class McapFile:
    """An MCAP file. `messages` reads it from start to end; the first pass counts the damage.

    `limit_bytes` is the largest size of a chunk or record. `compressions` are the numbers of chunks by the name of their
    compression, `span_ns` the log times (ns) of the first and last message, None if the index does not state them.
    """

    path: Path
    message_counts: MessageCounts
    limit_bytes: int
    compressions: dict[str, int] = field(default_factory=dict)
    profile: str = ""
    span_ns: tuple[int, int] | None = None
    _size: int = 0
    _is_complete: bool = False  # the file ends with a footer
    _expected: int | None = None  # number of messages, by the index
    _chunk_offsets: list[int] = field(default_factory=list)  # by the index, ascending
    _bad_chunks: set[int] = field(default_factory=set)  # places of chunks that cannot be used
    _resumed: dict[int, int] = field(default_factory=dict)  # place of damage -> place where reading continued
    _damage: Damage = field(init=False)
    _records: RecordReader = field(init=False)

    def __post_init__(self) -> None:
        self._damage = Damage(self.path, self.message_counts)
        self._records = RecordReader(self._damage)
        self._size = self.path.stat().st_size
        with self.path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise LogError(f"{self.path}: not an MCAP file (its first bytes are wrong)")
            self.profile = profile_of(stream.read(_HEADER_BYTES))
            summary = read_summary(stream, self._size, self.limit_bytes)
        self._is_complete = summary is not None
        if summary is not None:
            self._enter(summary)

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Channels by number."""
        return self._records.channels.by_number

    @property
    def schemas(self) -> Mapping[int, Schema]:
        """Schemas by number."""
        return self._records.schemas.by_number

    @property
    def arrival_ns(self) -> int | None:
        """The log time (ns) of the last message; None before the first."""
        return self._records.arrival_ns

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel number, data) of every readable message, in recorded order; the same messages on every call.

        `channels` and `schemas` are complete after the first pass.
        """
        number = 0
        limit = max(self._size, _MIN_MESSAGE_LIMIT)
        self._records.restart()
        for message in self._messages():
            number += 1
            if number > limit:
                self._damage.lose("messages_beyond_one_per_byte", self._size)
                break
            yield message
        if self._expected is not None and number < self._expected:
            self._damage.note(f"{self._expected - number} of {self._expected} messages are missing")
        self._damage.is_first_pass = False

    def _messages(self) -> Iterator[tuple[int, bytes]]:
        """The messages of all records outside and inside chunks, up to the end of the data section."""
        chunks = ChunkUnpacker(self._size, self.limit_bytes, verifies=self._damage.is_first_pass)
        if self._damage.is_first_pass:
            self.compressions = chunks.compressions
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
                        self._damage.lose("rest_after_the_end", end)
                    elif not self._is_complete:
                        self._damage.note("the index at its end is missing; no message is")
                    break
                if opcode == CHUNK and body + length > self._size:
                    yield from self._records.messages(self._cut_chunk(chunks, stream), at, is_cut=True)
                if body + length > self._size or not self._belongs_here(stream, opcode, length):
                    at = self._resume(stream, at)
                    continue
                if opcode == CHUNK:
                    yield from self._chunk(chunks, stream, at, length)
                elif opcode in (SCHEMA, CHANNEL, MESSAGE):
                    if length > self.limit_bytes:
                        self._damage.lose("too_large_record", at)
                    else:
                        yield from self._records.messages(
                            RECORD.pack(opcode, length) + exactly(stream, length), at
                        )
                at = body + length
                stream.seek(at)
            else:
                if not self._is_complete:
                    self._damage.lose("end_of_file", at, " (cut, or the recorder was not stopped)")

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

    def _chunk(
        self, chunks: ChunkUnpacker, stream: IO[bytes], at: int, length: int
    ) -> Iterator[tuple[int, bytes]]:
        """The messages of the chunk at `at`; the stream is at its body, of `length` bytes."""
        if at in self._bad_chunks:
            return
        data = chunks.unpack(stream, length)
        if data is None:
            self._damage.lose(chunks.fault, at)
            self._bad_chunks.add(at)
        else:
            yield from self._records.messages(data, at)

    def _cut_chunk(self, chunks: ChunkUnpacker, stream: IO[bytes]) -> bytes:
        """The first records of a chunk that the end of the file cuts; the stream is at its body."""
        after = bisect_right(self._chunk_offsets, stream.tell())
        if self._is_complete or after < len(self._chunk_offsets):
            return b""  # the file is not cut here: the length of the chunk is wrong
        return chunks.unpack_cut(stream)

    def _enter(self, summary: Summary) -> None:
        """Enter the schemas, channels, statistics and places of chunks that the summary repeats."""
        for opcode, body in summary.records():
            self._records.define(opcode, body, summary.start)
        statistics = summary.statistics()
        if statistics is not None:
            self._expected, self.span_ns = statistics.messages, statistics.span_ns
        self._chunk_offsets = [offset for offset in summary.chunk_offsets() if offset < self._size]

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
        self._damage.lose(
            "damaged_part" if place is not None or self._is_complete else "last_record_of_cut_file", at
        )
        self._resumed[at] = self._size if place is None else place
        stream.seek(self._resumed[at])
        return self._resumed[at]
