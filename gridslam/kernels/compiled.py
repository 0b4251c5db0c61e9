"""Decorators that compile a function, and keep its machine code as long as its sources stay what they are."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from gridslam.kernels.machine_code_cache import cache_directory, cache_of


def compiled(function: Callable[..., Any]) -> Any:
    """The function as serial machine code."""
    return _compile(function, parallel=False)


def compiled_parallel(function: Callable[..., Any]) -> Any:
    """The function as machine code whose `prange` loops use all threads."""
    return _compile(function, parallel=True)


def _compile(function: Callable[..., Any], parallel: bool) -> Any:
    if not os.environ.get("NUMBA_CACHE_DIR"):
        vars(numba.config)["CACHE_DIR"] = str(cache_directory(Path(function.__code__.co_filename)))
    kernel: Any = numba.njit(parallel=parallel)(function)
    cache = cache_of(function)
    if cache is not None:
        kernel._cache = cache  # what njit(cache=True) does, with numba's own class
    return kernel
