"""Number of threads of the libraries, set by environment variables that they read at import or at the first parallel loop."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


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
