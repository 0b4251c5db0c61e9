"""Lines of a text log, plain or packed with gzip or bzip2, whatever state the file is in."""

from __future__ import annotations

import bz2
import gzip
import zlib
from collections.abc import Iterator
from io import BufferedIOBase, BufferedReader
from pathlib import Path

from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.read_ahead import BLOCK_BYTES, ReadAhead

_KEPT_BYTES = (
    96 << 20
)  # texts up to this size are unpacked once and kept, larger ones are unpacked for each pass


def open_unpacked(path: Path) -> BufferedIOBase:
    """The file's bytes, unpacked by what its first bytes say (not by its name)."""
    with path.open("rb") as stream:
        magic = stream.read(3)
    if magic[:2] == b"\x1f\x8b":
        return gzip.open(path, "rb")
    if magic == b"BZh":
        return bz2.open(path, "rb")
    return path.open("rb")


def open_ahead(path: Path) -> BufferedIOBase:
    """As `open_unpacked`; what is packed is unpacked in a thread of its own."""
    stream = open_unpacked(path)
    if packing_of(path) == "none":
        return stream
    return BufferedReader(ReadAhead(stream), BLOCK_BYTES)


def packing_of(path: Path) -> str:
    """`gzip`, `bzip2` or `none`."""
    with path.open("rb") as stream:
        magic = stream.read(3)
    return "gzip" if magic[:2] == b"\x1f\x8b" else "bzip2" if magic == b"BZh" else "none"


def beginning(path: Path, size: int = 1 << 16) -> bytes:
    """The first bytes of the unpacked text, as far as they can be had."""
    text = b""
    try:
        with open_unpacked(path) as stream:
            while len(text) < size and (part := stream.read1(4096)):
                text += part
    except (OSError, EOFError, zlib.error):
        return text
    return text


class TextLines:
    """Numbered lines, to be gone through as often as needed. Damage is entered in the message_counts once."""

    def __init__(self, path: Path, message_counts: MessageCounts, line_limit_bytes: int) -> None:
        self.path = path
        self._message_counts = message_counts
        self._limit = line_limit_bytes
        self._kept: list[bytes] | None = None
        self._entered: set[tuple[str, int]] = set()
        self._read_before = False

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """(line number from 1, line without its end). A line that is too long comes as an empty one."""
        if self._kept is not None:
            yield from enumerate(self._kept, start=1)
            return
        keep: list[bytes] | None = [] if not self._read_before else None
        size = 0
        for number, line in enumerate(self._unpacked(), start=1):
            if keep is not None:
                keep.append(line)
                size += len(line)
                if size > _KEPT_BYTES:
                    keep = None
            yield number, line
        self._kept = keep
        self._read_before = True

    def _unpacked(self) -> Iterator[bytes]:
        number = 0
        with open_ahead(self.path) as stream:
            while True:
                try:
                    line = stream.readline(self._limit)
                    too_long = len(line) >= self._limit and not line.endswith(b"\n")
                    while len(line) >= self._limit and not line.endswith(b"\n"):
                        line = stream.readline(self._limit)
                except (OSError, EOFError, zlib.error) as error:
                    self._lose("rest_of_packed_text", number, f"after line {number} ({error})")
                    return
                if not line and not too_long:
                    return
                number += 1
                if too_long:
                    self._lose("too_long_line", number, f"line {number}")
                    yield b""
                    continue
                yield line.rstrip(b"\r\n")

    def _lose(self, what: str, number: int, where: str) -> None:
        """Enter damage in the message_counts, the same damage once whatever the number of passes."""
        if (what, number) not in self._entered:
            self._entered.add((what, number))
            self._message_counts.lose(what, f"{self.path.name} {where}")
