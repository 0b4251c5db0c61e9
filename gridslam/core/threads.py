"""How many threads the libraries use: told by the environment, read when they are imported or first run a parallel loop."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


def limit_threads(count: int) -> None:
    """Let all libraries that this process imports from here on use so many threads."""
    os.environ.update(dict.fromkeys(VARIABLES, str(count)))


@contextmanager
def threads_each(count: int) -> Iterator[None]:
    """Environment in which started processes use so many threads; what the user has set stays."""
    added = {name: str(count) for name in VARIABLES if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
