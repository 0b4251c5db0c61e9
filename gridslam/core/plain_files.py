"""Reads files that a user names, up to a size limit. A device or a pipe, which may never end, is refused."""

from __future__ import annotations

import errno
import hashlib
from pathlib import Path
from typing import BinaryIO

_BLOCK_BYTES = 1 << 20
MAX_JSON_BYTES = 1 << 28  # largest document that the program wrote itself


def read_plain_file(path: Path, max_bytes: int) -> bytes:
    """The content of a file.

    Raises OSError: it cannot be read, is larger than `max_bytes`, or is a device or a pipe.
    """
    with open_plain_file(path) as stream:
        data = bytearray()  # a read of `max_bytes` would take that memory first
        while len(data) <= max_bytes and (block := stream.read(_BLOCK_BYTES)):
            data += block
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes} bytes", str(path))
    return bytes(data)


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file's content. Raises OSError: it cannot be read, or is a device or a pipe."""
    digest = hashlib.sha256()
    with open_plain_file(path) as stream:
        while block := stream.read(_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def open_plain_file(path: Path) -> BinaryIO:
    """The file opened for reading. Raises OSError: it cannot be read, or is a device or a pipe."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "a device or a pipe, no file", str(path))
    return path.open("rb")
