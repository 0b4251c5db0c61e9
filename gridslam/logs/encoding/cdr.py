"""CDR, the byte format of ROS 2 messages: 4 bytes of encapsulation, then fields aligned to their own size."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import Any

from numpy.typing import NDArray

from gridslam.core.errors import LogError
from gridslam.core.stamps import split_stamp
from gridslam.core.texts import is_storable

LITTLE_ENDIAN = b"\x00\x01\x00\x00"


def check_text(value: str) -> None:
    """Raises LogError for a text that would not read back."""
    if not is_storable(value):
        raise LogError(f"the name {value!r} cannot be written: no format holds a zero or half a character")


class CdrReader:
    """Reads fields one after the other. Reading past the end raises struct.error or ValueError."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise ValueError("unknown encapsulation")
        self._order = "<" if data[1] else ">"
        self._data = data
        self._at = 4

    def numbers(self, code: str, count: int, size: int) -> tuple[float, ...]:
        """`count` numbers of struct code `code` and `size` bytes each."""
        self._at += -(self._at - 4) % size
        values = struct.unpack_from(f"{self._order}{count}{code}", self._data, self._at)
        self._at += count * size
        return values

    def uint32(self) -> int:
        """An unsigned number, such as a length."""
        return int(self.numbers("I", 1, 4)[0])

    def float64(self, count: int) -> tuple[float, ...]:
        """Double precision numbers."""
        return self.numbers("d", count, 8)

    def text(self) -> str:
        """A string (stored with its length; a zero ends it)."""
        length = self.uint32()
        raw = self._data[self._at : self._at + length]
        if len(raw) != length:
            raise ValueError("string reaches beyond the message")
        self._at += length
        return raw.partition(b"\0")[0].decode()

    def header(self) -> tuple[int, int, str]:
        """(seconds, nanoseconds, frame) of a std_msgs/Header."""
        seconds = int(self.numbers("i", 1, 4)[0])
        return seconds, self.uint32(), self.text()

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self._data) - self._at


class CdrWriter:
    """Puts fields one after the other, little-endian."""

    def __init__(self) -> None:
        self._parts = bytearray(LITTLE_ENDIAN)

    def numbers(self, code: str, values: Sequence[float], size: int) -> CdrWriter:
        """Numbers of struct code `code` and `size` bytes each."""
        self._align(size)
        self._parts += struct.pack(f"<{len(values)}{code}", *values)
        return self

    def uint8(self, *values: int) -> CdrWriter:
        """Bytes, or booleans."""
        return self.numbers("B", values, 1)

    def uint32(self, *values: int) -> CdrWriter:
        """Unsigned numbers, such as lengths."""
        return self.numbers("I", values, 4)

    def float32(self, *values: float) -> CdrWriter:
        """Single precision numbers."""
        return self.numbers("f", values, 4)

    def float64(self, *values: float) -> CdrWriter:
        """Double precision numbers."""
        return self.numbers("d", values, 8)

    def text(self, value: str) -> CdrWriter:
        """A string. Raises LogError as `check_text` does."""
        check_text(value)
        raw = value.encode() + b"\0"
        self.uint32(len(raw))
        self._parts += raw
        return self

    def texts(self, values: Iterable[str]) -> CdrWriter:
        """A sequence of strings."""
        listed = list(values)
        self.uint32(len(listed))
        for value in listed:
            self.text(value)
        return self

    def header(self, stamp_ns: int, frame: str) -> CdrWriter:
        """A std_msgs/Header."""
        seconds, nanoseconds = split_stamp(stamp_ns)
        self.numbers("i", [seconds], 4)
        self.uint32(nanoseconds)
        return self.text(frame)

    def sequence(self, values: NDArray[Any], size: int) -> CdrWriter:
        """A sequence of numbers of `size` bytes each, stored as the array holds them."""
        self.uint32(values.size)
        if values.size:
            self._align(size)
            self._parts += values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
        return self

    def data(self) -> bytes:
        """The finished message."""
        return bytes(self._parts)

    def _align(self, size: int) -> None:
        self._parts += b"\0" * (-(len(self._parts) - 4) % size)
