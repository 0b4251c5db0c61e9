"""The decorator that compiles a function, and keeps its machine code as long as its sources stay what they are."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba

from gridslam.kernels.machine_code_cache import MachineCodeCache


def compiled(function: Callable[..., Any]) -> Any:
    """The function as machine code. It runs without the interpreter's lock: see `threads` for work on several cores."""
    kernel: Any = numba.njit(nogil=True)(function)
    with suppress(OSError):  # sources that are not all there: compiled in every process
        kernel._cache = MachineCodeCache(function)  # what njit(cache=True) does, with numba's own class
    return kernel
