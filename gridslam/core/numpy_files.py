"""Reading numpy files (.npy, .npz) that may be damaged."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def damage_as_value_error() -> Iterator[None]:
    """Turn any error while a numpy file is read into a ValueError.

    numpy does not catch the errors of its parsers: zip, zlib, lzma, tokenize, compile, memory.
    """
    try:
        yield
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ValueError(f"a damaged numpy file: {reason}") from error
