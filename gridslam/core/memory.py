"""Large memory straight from the system, and memory that was freed back to it."""

from __future__ import annotations

import ctypes
import mmap
import sys
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

M_MMAP_THRESHOLD = -3  # the parameter of mallopt
LARGE_BYTES = 256 << 10  # smaller arrays come and go often, and pages take their time

Kind = TypeVar("Kind", bound=np.generic)


def system_zeros(size: int, dtype: type[Kind]) -> NDArray[Kind]:
    """`size` zeros, of which only the pages that are written take memory; the system gets it back with the array's last use.

    An allocator may clear all of such an array, and keep it when it is freed.
    """
    return np.frombuffer(mmap.mmap(-1, max(size, 1) * np.dtype(dtype).itemsize), dtype, size)


def return_freed_memory() -> None:
    """Give the system what was freed: glibc keeps it for later, and where it lay between small objects much of it.

    Worth its milliseconds where a stage of a run ends and the next one takes large arrays. Without glibc it does nothing.
    """
    _glibc("malloc_trim", 0)


def take_large_arrays_from_the_system() -> None:
    """Let glibc take each array of `LARGE_BYTES` from the system, which gets it back when it is freed.

    Left to itself it does so until the first of them is freed, and then keeps memory for those to come.
    """
    _glibc("mallopt", M_MMAP_THRESHOLD, LARGE_BYTES)


def _glibc(name: str, *numbers: int) -> None:
    """Call one of the functions by which glibc lets its memory be controlled, where they are."""
    if sys.platform == "linux":
        function = getattr(ctypes.CDLL(None), name, None)
        if function is not None:
            function(*numbers)
