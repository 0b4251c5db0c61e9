"""Memory that was freed, back to the system."""

from __future__ import annotations

import ctypes
import sys


def return_freed_memory() -> None:
    """Give the system what was freed: glibc keeps it for later, and where it lay between small objects much of it.

    Worth its milliseconds where a stage of a run ends and the next one takes large arrays. Without glibc it does nothing.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
