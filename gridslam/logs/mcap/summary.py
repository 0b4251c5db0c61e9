"""The summary at the end of an MCAP file: schemas and channels again, statistics, and the place of every chunk."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

from gridslam.logs.mcap.records import FOOTER, MAGIC, RECORD, exactly

FOOTER_BYTES = RECORD.size + 20 + len(MAGIC)


@dataclass(frozen=True, slots=True)
class Summary:
    """The bytes of the summary, at `start` in the file; empty where there is none, or where its checksum is wrong."""

    start: int
    data: bytes

    def records(self) -> Iterator[tuple[int, bytes]]:
        """(opcode, body) of each record, up to one that is cut."""
        position = 0
        while position + RECORD.size <= len(self.data):
            opcode, length = RECORD.unpack_from(self.data, position)
            body = self.data[position + RECORD.size : position + RECORD.size + length]
            position += RECORD.size + length
            if len(body) < length:
                return
            yield opcode, body


def read_summary(stream: IO[bytes], size: int, limit_bytes: int) -> Summary | None:
    """The summary of a file of `size` bytes; None where the file does not end with a footer: it is incomplete."""
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
