"""The summary at the end of an MCAP file: schemas and channels again, statistics, and the place of every chunk."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

from gridslam.logs.mcap.records import CHUNK_INDEX, FOOTER, MAGIC, RECORD, STATISTICS, exactly

FOOTER_BYTES = RECORD.size + 20 + len(MAGIC)


@dataclass(frozen=True, slots=True)
class Statistics:
    """Number of messages in the file; log times (ns) of the first and the last, None if not stated."""

    messages: int
    span_ns: tuple[int, int] | None


@dataclass(frozen=True, slots=True)
class Summary:
    """The bytes of the summary, at `start` in the file; empty if there is none, or if its checksum is wrong."""

    start: int
    data: bytes

    def statistics(self) -> Statistics | None:
        """The statistics; None if the summary has none."""
        found = None
        for opcode, body in self.records():
            if opcode == STATISTICS and len(body) >= 8:
                messages = int.from_bytes(body[:8], "little")
                span_ns = found.span_ns if found is not None else None
                if len(body) >= 42 and messages:
                    span_ns = int.from_bytes(body[26:34], "little"), int.from_bytes(body[34:42], "little")
                found = Statistics(messages, span_ns)
        return found

    def chunk_offsets(self) -> list[int]:
        """Places of the chunks in the file, ascending."""
        return sorted(
            int.from_bytes(body[16:24], "little")
            for opcode, body in self.records()
            if opcode == CHUNK_INDEX and len(body) >= 24
        )

    def records(self) -> Iterator[tuple[int, bytes]]:
        """(opcode, body) of each record; the end of a cut one is not returned."""
        position = 0
        while position + RECORD.size <= len(self.data):
            opcode, length = RECORD.unpack_from(self.data, position)
            body = self.data[position + RECORD.size : position + RECORD.size + length]
            position += RECORD.size + length
            if len(body) < length:
                return
            yield opcode, body


def read_summary(stream: IO[bytes], size: int, limit_bytes: int) -> Summary | None:
    """The summary of a file of `size` bytes; None if the file does not end with a footer, so that it is incomplete."""
    if size < len(MAGIC) + FOOTER_BYTES:
        return None
    footer_at = size - FOOTER_BYTES
    stream.seek(footer_at)
    footer = stream.read(FOOTER_BYTES)
    opcode, length = RECORD.unpack_from(footer)
    if opcode != FOOTER or length != 20 or not footer.endswith(MAGIC):
        return None
    start, _, crc = struct.unpack_from("<QQI", footer, RECORD.size)
    if not len(MAGIC) <= start <= footer_at or footer_at - start > limit_bytes:
        return Summary(footer_at, b"")
    stream.seek(start)
    data = exactly(stream, footer_at - start)
    is_damaged = crc and zlib.crc32(footer[: RECORD.size + 16], zlib.crc32(data)) != crc
    return Summary(start, b"" if is_damaged else data)


def end_of_recording(stream: IO[bytes], at: int, size: int) -> int:
    """The place after the closing magic of the recording whose data section ends at `at`; `size` where its footer is missing.

    It lies before the end of a file to which something was appended, such as another recording.
    """
    while at + RECORD.size <= size:
        stream.seek(at)
        opcode, length = RECORD.unpack(exactly(stream, RECORD.size))
        at += RECORD.size + length
        if opcode == FOOTER:
            return min(at + len(MAGIC), size)
    return size
