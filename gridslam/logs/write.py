"""Write a log: MCAP when the name ends in .mcap, a folder of CSV files otherwise."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Protocol

from gridslam.core.errors import ConfigError
from gridslam.core.files import check_file_free
from gridslam.core.messages import Event, Odometry

_READ_ONLY_FORMATS = (".bag", ".db3", ".clf", ".gz", ".bz2")


class LogWriter(Protocol):
    """A writer of logs. The log appears under its name when `close` succeeds; after an exception in `with` nothing remains."""

    def __enter__(self) -> LogWriter: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def write(self, event: Event, topic: str | None = None) -> None:
        """Append one event."""

    def write_truth(self, pose: Odometry) -> None:
        """Append a true pose, which methods do not read."""

    def complete(self) -> None:
        """Write the rest of the log under its temporary name. Nothing may be appended afterwards."""

    def close(self) -> None:
        """Complete the log, and give it its final name."""

    def abandon(self) -> None:
        """Remove what was written."""


def open_writer(path: str | Path, force: bool = False, as_rosbag2: bool = False) -> LogWriter:
    """A writer of an MCAP file if the path ends in .mcap, else of a CSV folder; with `as_rosbag2`, of a rosbag2 folder.

    Raises ConfigError: the path exists (`force` replaces a log of the same format), or has the suffix of a format that is only
    read.
    """
    path = Path(path)
    if as_rosbag2:
        from gridslam.logs.rosbag.writer import Rosbag2Writer

        return Rosbag2Writer(path, force)
    if path.suffix in _READ_ONLY_FORMATS:
        raise ConfigError(
            f"{path}: {path.suffix} is not written; name a file OUT.mcap, a folder for CSV files, or -o DIR for a rosbag2 folder"
        )
    if path.suffix == ".mcap":
        from gridslam.logs.mcap.writer import McapWriter

        check_file_free(path, force)
        return McapWriter(path)
    from gridslam.logs.csv.writer import CsvFolderWriter

    return CsvFolderWriter(path, force)


def write_log(path: str | Path, events: Iterable[Event], force: bool = False) -> None:
    """Write a log with the given events, in their order. `path` and `force` as for `open_writer`, whose errors are raised."""
    with open_writer(path, force) as writer:
        for event in events:
            writer.write(event)
