"""Atomic writing: files and folders are either complete or absent; and checks of what may be replaced.

An unfinished output is called `.NAME.xxxxxxxx.partial`, beside its target, and is locked by its writer.
"""

from __future__ import annotations

import errno
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

STALE_AFTER_S = 60.0  # younger unlocked outputs may be about to be locked by their writer
Identity = tuple[int, int, int]  # device, inode and time of change of a file
ANY: Identity = (-1, -1, -1)  # any existing file may be replaced
_RANDOM = "[a-z0-9_]{8}"  # inserted by tempfile between a name and its suffix
_MAX_NAME_BYTES = 255 - len("..12345678.partial")


def real_path(path: Path) -> Path:
    """The absolute path without symbolic links. A loop of links is kept, so that opening the path fails."""
    return Path(os.path.realpath(path))


def write_atomic(path: Path, data: bytes | Iterable[bytes]) -> None:
    """Write `data`, or its pieces, under a temporary name beside `path`, then rename: readers never see an incomplete file."""
    with partial_file(path) as stream:
        stream.writelines([data] if isinstance(data, bytes) else data)
        put_file(stream, path)


@contextmanager
def partial_file(target: Path) -> Iterator[IO[bytes]]:
    """A file under a temporary name, renamed to the target by `put_file`, otherwise removed.

    Raises ConfigError: the file cannot be created.
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


def put_file(stream: IO[bytes], target: Path, before: Identity | None = ANY) -> None:
    """Close a partial file and rename it to its target.

    `before` is what was there when the work began. Raises ConfigError: another process has put a file there since.
    """
    stream.close()
    temporary = Path(stream.name)
    temporary.chmod(0o666 & ~_umask())
    refuse_if_made_since(target, before)
    temporary.replace(target)


def identity_of(target: Path) -> Identity | None:
    """Identity of the file or folder at a path, which shows whether it is replaced later; None if the path does not exist."""
    try:
        state = target.stat()
    except OSError:
        return None
    return (state.st_dev, state.st_ino, 0 if target.is_dir() else state.st_mtime_ns)


def refuse_if_made_since(target: Path, before: Identity | None) -> None:
    """Raise ConfigError if the path has another identity than `before`: another process has written it."""
    now = identity_of(target)
    if before != ANY and now not in (None, before):
        raise ConfigError(f"{target}: another process has written it meanwhile; it is left as it is")


def remove(target: Path) -> None:
    """Remove a file or a folder; a folder is gone at once, not file by file."""
    if not target.is_dir():
        target.unlink(missing_ok=True)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".old", dir=target.parent))
    target.replace(aside)
    shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def partial_folder(target: Path) -> Iterator[Path]:
    """A folder under a temporary name, renamed to the target by `put_folder`, otherwise removed.

    Raises ConfigError: the folder cannot be created.
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


def put_folder(folder: Path, target: Path, before: Identity | None = ANY) -> None:
    """Rename a complete folder to its target; an existing target is deleted after the new folder is in place.

    `before` is what was there when the work began. Raises ConfigError: another process has put something there since.
    """
    if not target.exists() or not any(target.iterdir()):
        try:
            folder.replace(target)  # a rename may replace an empty folder
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST):
                refuse_if_made_since(target, None)
            raise
        return
    refuse_if_made_since(target, before)
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".old", dir=target.parent))
    target.replace(aside)
    try:
        refuse_if_made_since(aside, before)  # another process may have been quicker than the check above
        folder.replace(target)
    except BaseException:
        with suppress(OSError):
            aside.replace(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def remove_left_over(target: Path) -> None:
    """Remove unfinished and replaced versions of `target` left by killed processes."""
    pattern = re.compile(rf"\.{re.escape(target.name)}\.{_RANDOM}\.(partial|old)")
    for path in target.parent.iterdir():
        match = pattern.fullmatch(path.name)
        if match is None or (match[1] == "old" and not target.exists()):
            continue  # the replaced version may be the only one
        with suppress(OSError):
            is_old = time.time() - path.stat().st_mtime > STALE_AFTER_S
            with _opened(path) as handle, _locked(handle) as is_free:
                if is_old and is_free:
                    shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()


def check_name(path: Path) -> None:
    """Raise ConfigError for a name that is too long for its temporary form."""
    if len(os.fsencode(path.name)) > _MAX_NAME_BYTES:
        raise ConfigError(f"{path}: the name is longer than {_MAX_NAME_BYTES} bytes; choose a shorter one")


def check_has_name(path: Path) -> None:
    """Raise ConfigError for `.`, `..` or `/`, which have no name from which temporary names could be made."""
    if path.name in ("", ".", ".."):
        raise ConfigError(f"{path}: is not a name for an output; choose another")


def check_file_free(path: Path, force: bool) -> None:
    """Raise ConfigError unless a file may be written here: a new path, or with `force` an existing file.

    Called before the work, so that its result can be saved.
    """
    check_name(path)
    if path.exists() and not path.is_file():
        raise ConfigError(f"{path}: exists and is not a file, so it is never replaced; choose another name")
    if path.exists() and not force:
        raise ConfigError(f"{path}: exists; choose another name or use --force")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: cannot be written: {path.parent} is not a folder")


def refuse_to_replace(target: Path, inputs: Iterable[Path]) -> None:
    """Raise ConfigError if an input is the target or lies inside it."""
    for path in inputs:
        if real_path(path).is_relative_to(real_path(target)):
            raise ConfigError(f"{target}: would replace the input {path}; choose another output")


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    handle = os.open(path, os.O_RDONLY)
    try:
        yield handle
    finally:
        os.close(handle)


@contextmanager
def _locked(handle: int) -> Iterator[bool]:
    """Hold a lock until the block or the process ends; yields False if another process holds it.

    A file system without locks counts as locked.
    """
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        yield False
    else:
        yield True


@contextmanager
def making(target: Path) -> Iterator[None]:
    """Turn an OSError while the target is created into a ConfigError."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written ({error.strerror}); choose another name") from None


@contextmanager
def _naming(target: Path) -> Iterator[None]:
    """Make an OSError name the target, instead of its temporary name or no file."""
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
    """The umask of the process, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
