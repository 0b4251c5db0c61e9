"""Chunks of an MCAP file: records packed together, with a checksum."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO

from gridslam.logs.mcap.records import exactly

CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, unpacked size, crc, length of the compression's name
# Largest ratio of unpacked to packed size, of a chunk and of all chunks together; that of sensor data stays below 100
_MAX_EXPANSION = 1000
_ALWAYS_UNPACKED = 64 << 20  # bytes up to which the ratio does not matter


@dataclass(slots=True)
class ChunkUnpacker:
    """Unpacks the chunks of a file of `file_bytes`, in one pass over it.

    Chunks of more than `limit_bytes` are refused, and those that unpack to far more than sensor data do. `compressions` counts
    the chunks that were unpacked by the name of their compression; `fault` is the reason why the last chunk was not.
    """

    file_bytes: int
    limit_bytes: int
    verifies: bool  # whether the checksums are compared
    compressions: dict[str, int] = field(default_factory=dict)
    fault: str = ""
    _unpacked: int = 0  # bytes of all chunks so far

    def unpack(self, stream: IO[bytes], length: int) -> bytes | None:
        """The records of the chunk at the stream's position, whose record body has `length` bytes; None, with a `fault`."""
        self.fault = "chunk_of_impossible_size"
        if not CHUNK_HEAD.size + 8 <= length <= self.limit_bytes:
            return None
        body = exactly(stream, length)
        _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(body)
        start = CHUNK_HEAD.size + name_length + 8
        packed_size = int.from_bytes(body[start - 8 : start], "little")
        if start + packed_size > length or size > self.limit_bytes or self._is_bomb(size, packed_size):
            return None
        self._unpacked += size
        self.fault = "chunk_that_cannot_be_unpacked"
        name = body[CHUNK_HEAD.size : start - 8].decode("utf-8", "replace")
        data = unpack(name, body[start : start + packed_size], size)
        if data is None:
            return None
        self.compressions[name or "none"] = self.compressions.get(name or "none", 0) + 1
        if self.verifies and crc and zlib.crc32(data) != crc:
            self.fault = "chunk_with_wrong_checksum"
            return None
        return data

    def unpack_cut(self, stream: IO[bytes]) -> bytes:
        """The first records of the chunk at the stream's position, whose end the file does not have."""
        return unpack_beginning(stream.read(self.limit_bytes), min(_ALWAYS_UNPACKED, self.limit_bytes))

    def _is_bomb(self, size: int, packed_size: int) -> bool:
        """Whether a chunk, alone or together with the earlier ones, would unpack to far more than sensor data do."""
        return size > max(_ALWAYS_UNPACKED, _MAX_EXPANSION * packed_size) or self._unpacked + size > max(
            _ALWAYS_UNPACKED, _MAX_EXPANSION * self.file_bytes
        )


def is_chunk_body(stream: IO[bytes], length: int) -> bool:
    """Whether the record body at the stream's position is that of a chunk: the lengths in it add up to `length`."""
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
    """`data` unpacked to exactly `size` bytes, never more; None if that cannot be done."""
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
    """The first records of a chunk whose end is missing, at most `limit_bytes`; `body` is what there is of its record."""
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
