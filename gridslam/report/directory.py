"""A run directory that is either whole or not there."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gridslam.core.errors import ConfigError

REPORT_NAME = "report.json"
REPORT_FORMAT = "gridslam run"
STALE_AFTER_S = 60.0  # a folder is locked by its writer from its first moments on


def check_free(directory: Path, force: bool) -> None:
    """ConfigError unless a run may be written here: nothing there, an empty folder, an old run and `force`.

    Asked before the run as well as after it, so that nobody waits for a map that cannot be saved.
    """
    if directory.is_symlink() and not directory.exists():
        raise ConfigError(f"{directory}: a symbolic link to nothing; give another output folder")
    if not directory.exists() or (directory.is_dir() and not any(directory.iterdir())):
        _check_parent(directory)
        return
    if not is_run_directory(directory):
        raise ConfigError(
            f"{directory}: exists and is not a run, so it is never replaced: give another output folder"
        )
    if not force:
        raise ConfigError(
            f"{directory}: exists; give another output folder, or --force to replace the run in it"
        )
    _check_parent(directory)


def is_run_directory(directory: Path) -> bool:
    """Whether gridslam wrote this folder: its report.json says so."""
    try:
        document = json.loads((directory / REPORT_NAME).read_bytes())
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.get("format") == REPORT_FORMAT


@contextmanager
def new_run_directory(directory: Path, force: bool = False) -> Iterator[Path]:
    """A temporary folder beside `directory`, renamed to it when the block ends, removed when it fails.

    An old run is moved aside, and deleted only when the new one stands in its place. What runs into the same place have left
    that were killed on the way is removed.
    Raises ConfigError as `check_free` does, or when the folder cannot be made.
    """
    target = directory.resolve()
    check_free(target, force)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".partial", dir=target.parent))
    except OSError as error:
        raise ConfigError(
            f"{directory}: cannot be written ({error.strerror}); give another output folder"
        ) from None
    try:
        with _locked(temporary):
            _remove_left_over(target)
            temporary.chmod(0o777 & ~_umask())
            yield temporary
            check_free(target, force)
            _move_in(temporary, target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


@contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Hold the folder's lock, which the system gives up with the process, whatever ends it; False: another process holds it.

    File systems without locks on folders count as locked by another.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            yield False
        else:
            yield True
    finally:
        os.close(handle)


def _remove_left_over(target: Path) -> None:
    """Remove folders beside `target` that a killed process was writing for it, and old runs that it had moved aside."""
    pattern = re.compile(rf"\.{re.escape(target.name)}\.[a-z0-9_]{{8}}\.(partial|old)")
    for folder in target.parent.iterdir():
        match = pattern.fullmatch(folder.name)
        if match is None or (match[1] == "old" and not target.exists()):
            continue  # an old run that nothing has replaced yet may be all that there is
        with suppress(OSError):
            is_old = time.time() - folder.stat().st_mtime > STALE_AFTER_S
            with _locked(folder) as is_left:
                if is_old and is_left:
                    shutil.rmtree(folder, ignore_errors=True)


def _check_parent(directory: Path) -> None:
    """The nearest folder above that exists must be a folder, and writable."""
    above = directory.resolve().parent
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir():
        raise ConfigError(f"{directory}: cannot be made, for {above} is not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise ConfigError(f"{directory}: cannot be made, for {above} is not writable")


def _move_in(temporary: Path, target: Path) -> None:
    if not target.exists() or not any(target.iterdir()):
        temporary.replace(target)  # a rename may replace an empty folder
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".old", dir=target.parent))
    target.replace(aside)
    try:
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            aside.replace(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _umask() -> int:
    """The process's umask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
