"""Ranges of independent items shared among threads.

Kernels release the interpreter's lock, so that plain threads run them side by side. Numba's own parallel loops would do
the same, but take several times longer to compile and to load.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from typing import Any

import numba

# Number of ranges, so that threads end at about the same time although items differ in cost
RANGES_PER_THREAD = 8

_count = int(vars(numba.config)["NUMBA_NUM_THREADS"])  # the number of cores, or NUMBA_NUM_THREADS


def run_in_ranges(kernel: Any, count: int, arguments: tuple[Any, ...], smallest: int = 1) -> None:
    """Call kernel(first, last, *arguments) for ranges that together cover the items 0..count - 1, on all threads.

    A range has at least `smallest` items, where there are as many: handing one to a thread takes some 50 us.

    The kernel writes the results of each item into arguments, and reads nothing that it writes for another item; so
    they do not depend on the number of threads. A signal that comes meanwhile on several threads ends the work at the next range.
    """
    parts = min(max(count // smallest, 1), _count * RANGES_PER_THREAD)
    threads = min(_count, parts)
    if threads <= 1:
        kernel(0, count, *arguments)
        return
    if not kernel.signatures:
        kernel(0, 0, *arguments)  # compiles or loads it, on this thread
    bounds = [count * part // parts for part in range(parts + 1)]
    pool = _pool(os.getpid(), threads)
    futures = [pool.submit(kernel, first, last, *arguments) for first, last in pairwise(bounds)]
    try:
        for future in futures:
            future.result()
    except BaseException:
        for future in futures:
            future.cancel()
        raise


@contextmanager
def on_threads(count: int) -> Iterator[None]:
    """Within the block kernels use `count` threads."""
    global _count
    before, _count = _count, count
    try:
        yield
    finally:
        _count = before


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of this process; after a fork those of the parent are gone."""
    return ThreadPoolExecutor(threads, thread_name_prefix="kernels")
