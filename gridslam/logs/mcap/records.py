"""The records of MCAP: (opcode u8, length u64, body), little-endian.

After the magic come schemas, channels and messages, in chunks or bare; a file that was closed properly ends
with a summary (schemas and channels again, the place of every chunk) and a footer. Specification:
https://mcap.dev/spec
"""

from __future__ import annotations

import struct
from typing import IO

from gridslam.core.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, DATA_END = 0x0B, 0x0F
KNOWN_OPCODES = range(1, 16)
# Skipped in the data section: message index, attachment, metadata
SKIPPED_OPCODES = (MESSAGE_INDEX, 0x09, 0x0C)
RECORD = struct.Struct("<BQ")
MESSAGE_RECORD = struct.Struct("<BQH")
MESSAGE_HEAD_BYTES = 22  # channel u16, sequence u32, log time u64, publish time u64


def profile_of(head: bytes) -> str:
    """The profile that the header names, given the bytes after the magic; empty where there is none."""
    try:
        return text(head, RECORD.size)[0] if head[:1] == bytes([HEADER]) else ""
    except (ValueError, UnicodeDecodeError):
        return ""


def exactly(stream: IO[bytes], size: int) -> bytes:
    """The next `size` bytes of a stream. Raises LogError: the file became shorter while it was read."""
    data = stream.read(size)
    if len(data) != size:
        raise LogError(f"{getattr(stream, 'name', 'the log')}: became shorter while it was read; run again")
    return data


def block(body: bytes, at: int) -> tuple[bytes, int]:
    """A field with its length in front, from offset `at`, and the offset behind it. Raises ValueError: it is cut."""
    end = at + 4 + int.from_bytes(body[at : at + 4], "little")
    if at + 4 > len(body) or end > len(body):
        raise ValueError("field reaches beyond its record")
    return body[at + 4 : end], end


def text(body: bytes, at: int) -> tuple[str, int]:
    """A text field in UTF-8 from offset `at`, and the offset behind it, as `block`."""
    raw, end = block(body, at)
    return raw.decode(), end
