"""A run directory that is either whole or not there."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gridslam.core.errors import ConfigError
from gridslam.core.files import check_name, making, partial_folder, put_folder, refuse_to_replace

REPORT_NAME = "report.json"
REPORT_FORMAT = "gridslam run"
MIN_FREE_BYTES = 64 << 20  # a large map with its layers, pictures and report


def check_free(directory: Path, force: bool, inputs: Iterable[Path] = ()) -> None:
    """ConfigError unless a run may be written here: nothing there, an empty folder, an old run and `force`.

    An old run that holds one of the `inputs` of the new one is not replaced either.
    Asked before the run as well as after it, so that nobody waits for a map that cannot be saved.
    """
    check_name(directory)
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
    refuse_to_replace(directory, inputs)
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
    with making(directory):
        target.parent.mkdir(parents=True, exist_ok=True)
    with partial_folder(target) as folder:
        yield folder
        check_free(target, force)
        put_folder(folder, target)


def _check_parent(directory: Path) -> None:
    """The nearest folder above that exists must be a folder that takes new files, with room for a run."""
    above = directory.resolve().parent
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir():
        raise ConfigError(f"{directory}: cannot be made, for {above} is not a folder")
    try:
        Path(tempfile.mkdtemp(prefix=".gridslam-", dir=above)).rmdir()
        free_bytes = shutil.disk_usage(above).free
    except OSError as error:
        raise ConfigError(
            f"{directory}: cannot be written ({error.strerror}); give another output folder"
        ) from None
    if free_bytes < MIN_FREE_BYTES:
        raise ConfigError(
            f"{directory}: only {free_bytes >> 20} MB are free there, and a run may need {MIN_FREE_BYTES >> 20}; "
            "make room or give another output folder"
        )
