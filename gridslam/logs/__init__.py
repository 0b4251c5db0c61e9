"""Logs in and out: MCAP, CSV folders, CARMEN, rosbag2 and ROS 1 bags, as events in order.

`open_log` and `require_streams` read, `open_writer` writes, `LogConfig` is the `log` section of a
configuration.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gridslam.logs.config import LogConfig
    from gridslam.logs.csv.writer import CsvFolderWriter
    from gridslam.logs.log import Log
    from gridslam.logs.mcap.writer import McapWriter
    from gridslam.logs.open import open_log
    from gridslam.logs.requirements import require_streams
    from gridslam.logs.write import open_writer, write_log

_HOME = {
    "Log": "log",
    "LogConfig": "config",
    "open_log": "open",
    "require_streams": "requirements",
    "open_writer": "write",
    "write_log": "write",
    "McapWriter": "mcap.writer",
    "CsvFolderWriter": "csv.writer",
}
__all__ = [
    "CsvFolderWriter",
    "Log",
    "LogConfig",
    "McapWriter",
    "open_log",
    "open_writer",
    "require_streams",
    "write_log",
]


def __getattr__(name: str) -> Any:
    """Import a name at its first use."""
    if name in _HOME:
        import importlib

        return getattr(importlib.import_module(f"gridslam.logs.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
