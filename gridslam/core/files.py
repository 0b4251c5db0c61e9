"""Files and folders that are either whole or not there, and what they may replace.

What is being written lies beside its target as `.NAME.xxxxxxxx.partial`, locked by its writer, until it is whole.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from gridslam.core.errors import ConfigError

STALE_AFTER_S = 60.0  # what is being written is locked by its writer from its first moments on
_RANDOM = "[a-z0-9_]{8}"  # what tempfile puts between a name and its suffix
_LONGEST_NAME = 255 - len("..12345678.partial")  # bytes


def write_atomic(path: Path, data: bytes) -> None:
    """Write `data` under a temporary name beside `path`, then rename: no reader ever sees half a file."""
    with partial_file(path) as stream:
        stream.write(data)
        put_file(stream, path)


@contextmanager
def partial_file(target: Path) -> Iterator[IO[bytes]]:
    """A file under a temporary name, which `put_file` makes the target; without that it is removed.

    Raises ConfigError: no file can be made there.
    """
    with making(target):
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent)
    with _naming(target):
        try:
            os.close(handle)
            with Path(name).open("wb") as stream, _locked(stream.fileno()):
                yield stream
        finally:
            Path(name).unlink(missing_ok=True)


def put_file(stream: IO[bytes], target: Path) -> None:
    """Complete a partial file and give it its name."""
    stream.close()
    temporary = Path(stream.name)
    temporary.chmod(0o666 & ~_umask())
    temporary.replace(target)


@contextmanager
def partial_folder(target: Path) -> Iterator[Path]:
    """A folder under a temporary name, which `put_folder` makes the target; without that it is removed.

    Raises ConfigError: no folder can be made there.
    """
    with making(target):
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent))
    with _naming(target):
        try:
            with _opened(folder) as handle, _locked(handle):
                remove_left_over(target)
                folder.chmod(0o777 & ~_umask())
                yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def put_folder(folder: Path, target: Path) -> None:
    """Give a complete folder its name; what stands there is deleted when the new one stands in its place."""
    if not target.exists() or not any(target.iterdir()):
        folder.replace(target)  # a rename may replace an empty folder
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".old", dir=target.parent))
    target.replace(aside)
    try:
        folder.replace(target)
    except BaseException:
        with suppress(OSError):
            aside.replace(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def remove_left_over(target: Path) -> None:
    """Remove what lies beside `target` of killed processes that were writing it, and what they had moved aside."""
    pattern = re.compile(rf"\.{re.escape(target.name)}\.{_RANDOM}\.(partial|old)")
    for left in target.parent.iterdir():
        match = pattern.fullmatch(left.name)
        if match is None or (match[1] == "old" and not target.exists()):
            continue  # what nothing has replaced yet may be all that there is
        with suppress(OSError):
            is_old = time.time() - left.stat().st_mtime > STALE_AFTER_S
            with _opened(left) as handle, _locked(handle) as is_left:
                if is_old and is_left:
                    shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink()


def check_name(path: Path) -> None:
    """ConfigError for a name that leaves no room for the temporary one."""
    if len(os.fsencode(path.name)) > _LONGEST_NAME:
        raise ConfigError(f"{path}: the name is longer than {_LONGEST_NAME} bytes; choose a shorter one")


def check_file_free(path: Path, force: bool) -> None:
    """ConfigError unless a file may be written here: nothing there, or a file and `force`.

    Asked before the work, so that nobody waits for what cannot be saved.
    """
    check_name(path)
    if path.exists() and not path.is_file():
        raise ConfigError(f"{path}: exists and is no file, so it is never replaced; choose another name")
    if path.exists() and not force:
        raise ConfigError(f"{path}: exists already; choose another name or give --force")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: cannot be written, for {path.parent} is not a folder")


def refuse_to_replace(target: Path, inputs: Iterable[Path]) -> None:
    """ConfigError where something that is read is the target or lies inside it."""
    for path in inputs:
        if path.resolve().is_relative_to(target.resolve()):
            raise ConfigError(f"{target}: would replace {path}, which is read; choose another output")


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    handle = os.open(path, os.O_RDONLY)
    try:
        yield handle
    finally:
        os.close(handle)


@contextmanager
def _locked(handle: int) -> Iterator[bool]:
    """Hold a lock, which the system gives up with the process, whatever ends it; False: another process holds it.

    File systems without locks count as locked by another.
    """
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        yield False
    else:
        yield True


@contextmanager
def making(target: Path) -> Iterator[None]:
    """ConfigError for errors of the system while a place for the target is made."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written ({error.strerror}); give another name") from None


@contextmanager
def _naming(target: Path) -> Iterator[None]:
    """Errors of the system name the output, where they name what is temporary or nothing at all."""
    try:
        yield
    except OSError as error:
        name = str(target) if error.filename is None else str(error.filename)
        temporary = re.fullmatch(
            rf"(?:.*/)?\.{re.escape(target.name)}\.{_RANDOM}\.partial(.*)", name, re.DOTALL
        )
        if error.errno is None or (error.filename is not None and temporary is None):
            raise
        name = f"{target}{temporary[1]}" if temporary else name
        raise OSError(error.errno, error.strerror, name) from error


def _umask() -> int:
    """The process's umask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
