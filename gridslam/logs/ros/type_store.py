"""The type library's store of message types, with bounds on what one message may cost.

A sequence can state as many structures as the message has bytes, and each becomes an object of a hundred bytes or more. The
library does not limit their number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rosbags.interfaces import Msgdef
from rosbags.typesys.store import Typestore

from gridslam.logs.ros.definitions import holds_lists_of_texts

# Largest number in one message; the largest sweep of a lidar has some 200,000 points
MAX_STRUCTURES = 500_000
_MAX_TEXTS_BYTES = 1 << 20  # largest message with sequences of texts: names of joints, tags


class BoundedTypestore(Typestore):
    """A type store whose `deserialize_cdr` and `ros1_to_cdr` raise ValueError for messages beyond these bounds."""

    def __init__(self, types: Typestore | None = None) -> None:
        super().__init__()
        if types is not None:
            self.fielddefs.update(types.fielddefs)
            self.types.update(types.types)
        self._left = 0
        self._with_texts: dict[str, bool] = {}

    def get_msgdef(self, typename: str) -> Msgdef[object]:
        """The definition of a type, whose functions for messages count the structures."""
        if typename not in self.cache:
            found = super().get_msgdef(typename)
            self.cache[typename] = replace(
                found,
                deserialize_cdr_le=self._counting(found.deserialize_cdr_le),
                deserialize_cdr_be=self._counting(found.deserialize_cdr_be),
                getsize_ros1_to_cdr=self._counting(found.getsize_ros1_to_cdr),
            )
        return self.cache[typename]

    def deserialize_cdr(self, rawdata: bytes | memoryview, typename: str) -> object:
        """The message as an object. Raises ValueError: it has too many parts."""
        self._start(len(rawdata), typename)
        return super().deserialize_cdr(rawdata, typename)

    def ros1_to_cdr(self, raw: bytes | memoryview, typename: str) -> memoryview:
        """The message in CDR. Raises ValueError: it has too many parts."""
        self._start(len(raw), typename)
        return super().ros1_to_cdr(raw, typename)

    def _start(self, size: int, name: str) -> None:
        self._left = MAX_STRUCTURES
        if size <= _MAX_TEXTS_BYTES:
            return
        if name not in self._with_texts:
            self._with_texts[name] = holds_lists_of_texts(self.fielddefs, name)
        if self._with_texts[name]:
            raise ValueError(f"{name}: {size} bytes with lists of texts")

    def _counting(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any) -> Any:
            self._left -= 1
            if self._left < 0:
                raise ValueError(f"more than {MAX_STRUCTURES} structures in a message")
            return function(*arguments)

        return counted
