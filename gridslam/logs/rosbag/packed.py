"""Recordings that `ros2 bag` has compressed: whole files, or each message on its own."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.logs.ros.container import Channel, Container, Schema

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
# Largest expansion of what unpacks to more than _ALWAYS_UNPACKED bytes; sensor data stay below 100
_MAX_EXPANSION = 1000
_ALWAYS_UNPACKED = 64 << 20
_BLOCK = 1 << 20


def is_packed(path: Path) -> bool:
    """Whether a file is compressed with zstd as a whole."""
    with path.open("rb") as stream:
        return stream.read(len(ZSTD_MAGIC)) == ZSTD_MAGIC


class UnpackedFile:
    """A copy of a packed file without its compression, at `path`, which exists as long as this object.

    Raises LogError: it cannot be unpacked, unpacks to more than any recording, or there is no room for the copy.
    """

    def __init__(self, packed: Path) -> None:
        import zstandard

        self.packed = packed
        folder = Path(tempfile.mkdtemp(prefix="gridslam-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        name = packed.name.removesuffix(".zstd").removesuffix(".zst")
        self.path = folder / (name if name != packed.name else f"{name}.unpacked")
        limit = max(_ALWAYS_UNPACKED, _MAX_EXPANSION * packed.stat().st_size)
        limit = min(limit, shutil.disk_usage(folder).free // 2)
        size = 0
        try:
            with packed.open("rb") as source, self.path.open("wb") as target:
                reader = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
                while block := reader.read(_BLOCK):
                    size += len(block)
                    if size > limit:
                        raise LogError(
                            f"{packed}: unpacks to more than {limit >> 20} MB, for which there is no room"
                        )
                    target.write(block)
        except (zstandard.ZstdError, OSError) as error:
            raise LogError(f"{packed}: cannot be unpacked ({error}); try `unzstd` on it") from error


class PackedMessages:
    """A container whose messages are compressed one by one with zstd; one that is not is passed on as it is."""

    def __init__(self, container: Container, limit_bytes: int) -> None:
        self._container = container
        self._limit = limit_bytes

    @property
    def channels(self) -> Mapping[int, Channel]:
        """Channels by number."""
        return self._container.channels

    @property
    def schemas(self) -> Mapping[int, Schema]:
        """Schemas by number."""
        return self._container.schemas

    @property
    def arrival_ns(self) -> int | None:
        """Time of arrival (ns) of the last message that was yielded; None if unknown."""
        return self._container.arrival_ns

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel, data); what cannot be unpacked is empty, which counts as undecodable."""
        import zstandard

        for channel, data in self._container.messages():
            if data[:4] == ZSTD_MAGIC:
                limit = min(max(_ALWAYS_UNPACKED, _MAX_EXPANSION * len(data)), self._limit)
                try:
                    with zstandard.ZstdDecompressor().stream_reader(data) as reader:
                        plain = bytes(reader.read(limit + 1))
                except zstandard.ZstdError:
                    plain = b""
                data = plain if len(plain) <= limit else b""
            yield channel, data
