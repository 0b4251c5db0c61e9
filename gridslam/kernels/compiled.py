"""The decorator that compiles a function, and keeps its machine code as long as its sources stay what they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from gridslam.kernels.machine_code_cache import cache_of


def compiled(function: Callable[..., Any]) -> Any:
    """The function as machine code. It runs without the interpreter's lock: see `threads` for work on several cores."""
    kernel: Any = numba.njit(nogil=True)(function)
    cache = cache_of(function)
    if cache is not None:
        kernel._cache = cache  # what njit(cache=True) does, with numba's own class
    return kernel
