"""Creates run directories, which are either complete or absent."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gridslam.core.errors import ConfigError
from gridslam.core.files import (
    ANY,
    Identity,
    check_name,
    identity_of,
    making,
    partial_folder,
    put_folder,
    real_path,
    refuse_to_replace,
)
from gridslam.core.plain_files import MAX_JSON_BYTES, read_plain_file

REPORT_NAME = "report.json"
REPORT_FORMAT = "gridslam run"
MIN_FREE_BYTES = 64 << 20  # size of a large map with its layers, pictures and report


def check_free(directory: Path, force: bool, inputs: Iterable[Path] = ()) -> Identity | None:
    """Raise ConfigError unless a run may be written here: a new path, an empty folder, or with `force` an earlier run.

    A run that contains one of the `inputs` is never replaced. The check is made before a run and again before writing. Returns
    the current identity of the path, by which `new_run_directory` notices that another process has written it since.
    """
    check_name(directory)
    if directory.is_symlink() and not directory.exists():
        raise ConfigError(f"{directory}: a broken symbolic link; choose another output folder")
    if not directory.exists() or (directory.is_dir() and not any(directory.iterdir())):
        _check_parent(directory)
        return None
    if not is_run_directory(directory):
        raise ConfigError(
            f"{directory}: exists and is not a run directory, so it is never replaced; choose another output folder"
        )
    if not force:
        raise ConfigError(
            f"{directory}: exists; choose another output folder, or --force to replace the run in it"
        )
    refuse_to_replace(directory, inputs)
    _check_parent(directory)
    return identity_of(directory)


def is_run_directory(directory: Path) -> bool:
    """Whether the folder is a run directory, by its report.json."""
    try:
        document = json.loads(read_plain_file(directory / REPORT_NAME, MAX_JSON_BYTES))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(document, dict) and document.get("format") == REPORT_FORMAT


@contextmanager
def new_run_directory(directory: Path, force: bool = False, before: Identity | None = ANY) -> Iterator[Path]:
    """A temporary folder beside `directory`, renamed to it at the end of the block, removed after an error.

    An earlier run is deleted only after the new one is in place. Remains of killed runs are removed. `before` is the identity
    that `check_free` returned before the run. Raises ConfigError as `check_free` does, or if the folder cannot be created, or if
    another process has written it since.
    """
    target = real_path(directory)
    check_free(target, force)
    with making(directory):
        target.parent.mkdir(parents=True, exist_ok=True)
    with partial_folder(target) as folder:
        yield folder
        check_free(target, force)
        put_folder(folder, target, before)


def _check_parent(directory: Path) -> None:
    """Raise ConfigError unless the nearest existing ancestor is a writable folder with room for a run."""
    above = real_path(directory).parent
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir():
        raise ConfigError(f"{directory}: cannot be created: {above} is not a folder")
    try:
        Path(tempfile.mkdtemp(prefix=".gridslam-", dir=above)).rmdir()
        free_bytes = shutil.disk_usage(above).free
    except OSError as error:
        raise ConfigError(
            f"{directory}: cannot be written ({error.strerror}); choose another output folder"
        ) from None
    if free_bytes < MIN_FREE_BYTES:
        raise ConfigError(
            f"{directory}: only {free_bytes >> 20} MB are free there, and a run may need {MIN_FREE_BYTES >> 20}; "
            "make room or choose another output folder"
        )
