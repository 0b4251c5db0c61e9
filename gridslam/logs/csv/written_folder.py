"""Check of folders that the writer of CSV folders may replace: only those that it has written."""

from __future__ import annotations

import re
from pathlib import Path

from gridslam.core.errors import ConfigError
from gridslam.core.files import check_name
from gridslam.logs.csv.source import LAYOUT_FILE
from gridslam.logs.kinds import CSV_KINDS, OLDER_NAMES

_PICTURE_FOLDERS = tuple(f"{name}_" for name, kind in CSV_KINDS.items() if kind.has_pictures)


def check_csv_free(path: Path, force: bool) -> None:
    """Raises ConfigError unless nothing is at the path, or `force` and a folder that this writer has written."""
    check_name(path)
    if not path.exists():
        return
    if not force:
        raise ConfigError(f"{path}: exists already; choose another name or give --force")
    if not path.is_dir() or not _is_written(path):
        raise ConfigError(
            f"{path}: exists and is not a folder of {LAYOUT_FILE} and CSV files that gridslam wrote, so it is never "
            "replaced; choose another name"
        )


def _is_written(folder: Path) -> bool:
    """Whether a folder is empty, or holds log.yaml and else only what the writer makes."""
    entries = list(folder.iterdir())
    return not entries or ((folder / LAYOUT_FILE).is_file() and all(map(_is_part, entries)))


def _is_part(entry: Path) -> bool:
    if entry.is_dir() and not entry.is_symlink():
        pictures = all(file.is_file() and file.suffix in (".png", ".npy") for file in entry.iterdir())
        return pictures and entry.name.startswith(_PICTURE_FOLDERS)
    table = re.fullmatch(r"(\w+?)(_\d+)?\.csv", entry.name)
    return entry.is_file() and (
        entry.name == LAYOUT_FILE or (table is not None and table[1] in (*CSV_KINDS, *OLDER_NAMES))
    )
