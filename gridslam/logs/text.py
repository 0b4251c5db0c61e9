"""Lines of a text log, plain or packed with gzip or bzip2, also of a damaged file."""

from __future__ import annotations

import bz2
import gzip
import zlib
from collections.abc import Container, Iterable, Iterator
from io import BufferedIOBase, BufferedReader
from pathlib import Path

from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.read_ahead import BLOCK_BYTES, ReadAhead

_KEPT_BYTES = 96 << 20  # texts up to this size are kept; larger ones are read again on each pass
_LINE_OVERHEAD_BYTES = 120  # memory of a kept line besides its text
_BLOCK_BYTES = 1 << 18
_MAX_EXPANSION = 100  # largest expansion of a packed text beyond _ALWAYS_UNPACKED bytes; logs reach 10
_ALWAYS_UNPACKED = 4 << 20


def open_unpacked(path: Path) -> BufferedIOBase:
    """The unpacked bytes of a file; its first bytes (not its name) say how it is packed."""
    with path.open("rb") as stream:
        magic = stream.read(3)
    if magic[:2] == b"\x1f\x8b":
        return gzip.open(path, "rb")
    if magic == b"BZh":
        return bz2.open(path, "rb")
    return path.open("rb")


def open_ahead(path: Path) -> BufferedIOBase:
    """A text log opened as by `open_unpacked`; a packed file is unpacked in a thread of its own."""
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
    """The first bytes of the unpacked text, as many as are readable."""
    text = b""
    try:
        with open_unpacked(path) as stream:
            while len(text) < size and (part := stream.read1(4096)):
                text += part
    except (OSError, EOFError, zlib.error):
        return text
    return text


def in_batches(
    lines: Iterable[tuple[int, bytes]], max_lines: int, max_bytes: int
) -> Iterator[list[tuple[int, bytes]]]:
    """Numbered lines in batches of at most `max_lines`; a batch ends early once it has `max_bytes`."""
    batch: list[tuple[int, bytes]] = []
    size = 0
    for line in lines:
        batch.append(line)
        size += len(line[1])
        if len(batch) >= max_lines or size >= max_bytes:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


class TextLines:
    """Numbered lines that are not empty, to be read as often as needed. Damage is counted once."""

    def __init__(self, path: Path, message_counts: MessageCounts, line_limit_bytes: int) -> None:
        self.path = path
        self._message_counts = message_counts
        self._line_limit = line_limit_bytes
        self._kept: list[tuple[int, bytes]] | None = None
        self._counted: set[tuple[str, int]] = set()
        self._read_before = False
        self._is_cut = False

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """(line number from 1, line without its end). Lines that are too long are left out and counted."""
        if self._kept is not None:
            yield from self._kept
            return
        keep: list[tuple[int, bytes]] | None = [] if not self._read_before else None
        size = 0
        for line in self._unpacked():
            if keep is not None:
                keep.append(line)
                size += len(line[1]) + _LINE_OVERHEAD_BYTES
                if size > _KEPT_BYTES:
                    keep = None
            yield line
        self._kept = keep
        self._read_before = True

    def shorten(self, numbers: Container[int], size: int) -> None:
        """Cut the kept lines of these numbers to their first `size` bytes: the rest is not needed any more."""
        if self._kept is not None:
            self._kept = [(number, line[:size] if number in numbers else line) for number, line in self._kept]

    def forget(self) -> None:
        """Free the kept lines; the next pass reads the file again."""
        self._kept = None

    def _unpacked(self) -> Iterator[tuple[int, bytes]]:
        """The lines of all blocks; empty lines cost next to nothing."""
        number, rest, is_too_long = 0, b"", False
        for block in self._blocks():
            first, *lines = block.split(b"\n")
            if not lines:  # no line ends in the block
                is_too_long = is_too_long or len(rest) + len(first) > self._line_limit
                rest = b"" if is_too_long else rest + first
                continue
            number += 1
            line = rest + first
            if is_too_long or len(line) > self._line_limit:
                self._lose("too_long_line", number, f"line {number}")
            elif line := line.rstrip(b"\r"):
                yield number, line
            rest, is_too_long = lines.pop(), False
            for place, line in enumerate(lines, start=number + 1):
                if len(line) > self._line_limit:
                    self._lose("too_long_line", place, f"line {place}")
                elif line and (line := line.rstrip(b"\r")):
                    yield place, line
            number += len(lines)
        if self._is_cut:  # in the middle of a line, probably
            return
        if is_too_long:
            self._lose("too_long_line", number + 1, f"line {number + 1}")
        elif rest := rest.rstrip(b"\r"):
            yield number + 1, rest

    def _blocks(self) -> Iterator[bytes]:
        """The unpacked text in blocks, up to damage or to more text than a log of this size holds."""
        self._is_cut = False
        is_packed = packing_of(self.path) != "none"
        limit = max(_ALWAYS_UNPACKED, _MAX_EXPANSION * self.path.stat().st_size)
        size = 0
        with open_ahead(self.path) as stream:
            while True:
                try:
                    block = stream.read1(_BLOCK_BYTES)  # what is readable before damage comes first
                except (OSError, EOFError, zlib.error) as error:
                    self._is_cut = True
                    self._lose("rest_of_packed_text", size, f"after {size} bytes ({error})")
                    return
                if not block:
                    return
                size += len(block)
                if is_packed and size > limit:
                    self._is_cut = True
                    self._lose(
                        "rest_of_packed_text", size, f"after {size} bytes (unpacks to far more than any log)"
                    )
                    return
                yield block

    def _lose(self, what: str, number: int, where: str) -> None:
        """Count damage; the same damage once, whatever the number of passes."""
        if (what, number) not in self._counted:
            self._counted.add((what, number))
            self._message_counts.lose(what, f"{self.path.name} {where}")
