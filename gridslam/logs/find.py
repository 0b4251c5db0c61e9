"""Expansion of a path into logs: the log itself, the matches of a pattern, or the recordings in a folder."""

from __future__ import annotations

import glob
import logging
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.logs.csv.source import LOG_ENDINGS
from gridslam.logs.csv_layout import default_files
from gridslam.logs.datasets.open import open_dataset
from gridslam.logs.rosbag.parts import numbered_files, recorded_parts, why_several

logger = logging.getLogger(__name__)

LOG_FILES = ("metadata.yaml", "log.yaml")  # a folder with one of these is a log


def find_logs(path: str | Path) -> list[Path]:
    """The logs that a path means, sorted by name; a pattern has `*`, `?` or `[`.

    A folder that is not a log means the logs in it. If it has none, it is returned itself, so that opening it raises the error.
    Raises LogError: a pattern matches nothing, or no file can have the name.
    """
    path = Path(path)
    try:
        exists = path.exists()
    except OSError as error:  # a name that is too long
        raise LogError(f"{str(path)[:60]}...: {error.strerror}") from None
    if exists or not glob.has_magic(str(path)):
        return logs_inside(path)
    matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207 - patterns may be absolute
    found = [log for match in matches for log in logs_inside(Path(match))]
    if not found:
        raise LogError(f"{path}: matches no file")
    return found


def logs_inside(path: Path) -> list[Path]:
    """The path itself if it is a file or a log, otherwise the logs that the folder holds."""
    if not path.is_dir() or is_log_folder(path):
        return [path]
    if reason := why_several(numbered_files(path)):
        logger.warning("%s: its recordings are several logs, not the parts of one: %s", path, reason)
    inside = [
        item for item in sorted(path.iterdir()) if not item.name.startswith(".") and _looks_like_log(item)
    ]
    return inside or [path]


def is_log_folder(folder: Path) -> bool:
    """Whether a folder is one log: a rosbag2 recording, a CSV folder or a dataset."""
    names = (*LOG_FILES, *default_files())
    if any((folder / name).is_file() for name in names) or recorded_parts(folder):
        return True
    try:
        return open_dataset(folder) is not None
    except LogError:  # a damaged dataset, which opening it again explains
        return True


def _looks_like_log(path: Path) -> bool:
    if path.is_dir():
        return not path.name.endswith(".truth") and is_log_folder(path)
    return path.name.endswith(LOG_ENDINGS)
