"""Files of numpy (.npy, .npz) that may be damaged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def damage_as_value_error() -> Iterator[None]:
    """For the lines that read such a file: a ValueError, whatever numpy came upon.

    It lets through what its parsers raise: of zip, zlib, lzma, tokenize, the compiler and the memory.
    """
    try:
        yield
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ValueError(f"not an undamaged file of numpy: {reason}") from error
