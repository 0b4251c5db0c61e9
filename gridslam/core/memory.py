"""Control of the C allocator: large arrays come from the system directly, and freed memory is returned to it."""

from __future__ import annotations

import ctypes
import mmap
import sys
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

M_MMAP_THRESHOLD = -3  # the parameter of mallopt
LARGE_BYTES = 256 << 10  # smaller arrays are allocated often, and mapping pages for them would take time

Kind = TypeVar("Kind", bound=np.generic)


def system_zeros(size: int, dtype: type[Kind]) -> NDArray[Kind]:
    """An array of `size` zeros. Its pages take memory only once they are written, and are returned to the system when freed.

    With `numpy.zeros` the allocator may write all pages, and keep the memory.
    """
    return np.frombuffer(mmap.mmap(-1, max(size, 1) * np.dtype(dtype).itemsize), dtype, size)


def return_freed_memory() -> None:
    """Return freed memory to the system, which glibc otherwise keeps for later allocations. Does nothing without glibc.

    It takes milliseconds: call it when a stage of a run has ended and the next one needs large arrays.
    """
    _glibc("malloc_trim", 0)


def take_large_arrays_from_the_system() -> None:
    """Make glibc allocate arrays of `LARGE_BYTES` or more from the system, and return them when they are freed.

    By default, glibc stops doing so once the first of them is freed, and keeps the memory.
    """
    _glibc("mallopt", M_MMAP_THRESHOLD, LARGE_BYTES)


def _glibc(name: str, *numbers: int) -> None:
    """Call a function of glibc that controls its memory; does nothing without glibc."""
    if sys.platform == "linux":
        function = getattr(ctypes.CDLL(None), name, None)
        if function is not None:
            function(*numbers)
