"""Number of threads of the libraries, set by environment variables that they read at import or at the first parallel loop."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
MAX_DIGITS = 4  # digits of a number of threads: no machine has more cores


def drop_wrong_counts() -> list[str]:
    """Remove the environment variables whose value is not a number of threads, and return them as `NAME=value`.

    With such a value, libraries would end the program. OpenMP also takes a list: a number for each level of nesting.
    """
    wrong = []
    for name in VARIABLES:
        text = os.environ.get(name)
        numbers = [] if text is None else text.split(",") if name.startswith("OMP") else [text]
        if not all(map(_is_count, numbers)):
            wrong.append(f"{name}={os.environ.pop(name)}")
    return wrong


def _is_count(text: str) -> bool:
    digits = text.strip()
    return digits.isascii() and digits.isdigit() and len(digits) <= MAX_DIGITS and int(digits) > 0


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
