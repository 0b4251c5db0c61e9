"""Number of threads of the libraries, set by environment variables that they read at import or at the first parallel loop."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


MAX_THREADS = 4096


def drop_wrong_counts() -> list[str]:
    """The variables `NAME=value` whose value is no number of threads; they are removed, or numba would end the program."""
    wrong = [
        name
        for name in VARIABLES
        if (text := os.environ.get(name)) is not None
        and not (text.isascii() and text.isdigit() and 0 < int(text[:9]) <= MAX_THREADS)
    ]
    return [f"{name}={os.environ.pop(name)}" for name in wrong]


def limit_threads(count: int) -> None:
    """Let libraries that are imported later use `count` threads."""
    os.environ.update(dict.fromkeys(VARIABLES, str(count)))


@contextmanager
def threads_each(count: int) -> Iterator[None]:
    """Let processes started in the block use `count` threads each, unless the user has set another number."""
    added = {name: str(count) for name in VARIABLES if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
