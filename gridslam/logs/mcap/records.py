"""The records of MCAP: (opcode u8, length u64, body), little-endian.

After the magic come schemas, channels and messages, in chunks or bare; a file that was closed properly ends
with a summary (schemas and channels again, the place of every chunk) and a footer. Specification:
https://mcap.dev/spec
"""

from __future__ import annotations

import struct
from contextlib import suppress
from typing import IO

from gridslam.core.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, DATA_END = 0x0B, 0x0F
KNOWN_OPCODES = range(1, 16)
SKIPPED_OPCODES = (MESSAGE_INDEX, 0x09, 0x0C)  # of the data section: message index, attachment, metadata
RECORD = struct.Struct("<BQ")
MESSAGE_RECORD = struct.Struct("<BQH")
CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, unpacked size, crc, length of the compression's name
MESSAGE_HEAD_BYTES = 22  # channel u16, sequence u32, log time u64, publish time u64


def is_chunk_body(stream: IO[bytes], length: int) -> bool:
    """Whether the record body at the stream's position is a chunk's: its inner lengths add up to `length`."""
    head = stream.read(CHUNK_HEAD.size)
    if len(head) < CHUNK_HEAD.size:
        return False
    name_length = int(CHUNK_HEAD.unpack(head)[4])
    if name_length > 16:
        return False
    stream.seek(name_length, 1)
    records_length = int.from_bytes(stream.read(8), "little")
    return bool(records_length + CHUNK_HEAD.size + name_length + 8 == length)


def unpack(compression: str, data: bytes, size: int) -> bytes | None:
    """`data` unpacked to exactly `size` bytes, never more; None where that cannot be done."""
    if compression == "":
        return data if len(data) == size else None
    if compression == "zstd":
        import zstandard

        try:
            with zstandard.ZstdDecompressor().stream_reader(data) as reader:
                plain = bytes(reader.read(size + 1))
        except zstandard.ZstdError:
            return None
    elif compression == "lz4":
        import lz4.frame

        try:
            plain = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        except (RuntimeError, EOFError):
            return None
    else:
        return None
    return plain if len(plain) == size else None


def unpack_beginning(body: bytes, limit_bytes: int) -> bytes:
    """The readable beginning of the data of a chunk whose end is missing, unpacked, at most `limit_bytes`."""
    if len(body) < CHUNK_HEAD.size:
        return b""
    name_length = int(CHUNK_HEAD.unpack_from(body)[4])
    start = CHUNK_HEAD.size + name_length + 8
    compression, packed = body[CHUNK_HEAD.size : start - 8], body[start:]
    if compression == b"":
        return packed[:limit_bytes]
    if compression == b"zstd":
        import zstandard

        with suppress(zstandard.ZstdError), zstandard.ZstdDecompressor().stream_reader(packed) as reader:
            return bytes(reader.read(limit_bytes))
    elif compression == b"lz4":
        import lz4.frame

        with suppress(RuntimeError, EOFError):
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=limit_bytes))
    return b""


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
