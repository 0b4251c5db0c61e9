"""MCAP as a source of streams."""

from __future__ import annotations

from pathlib import Path

from gridslam.logs.config import LogConfig
from gridslam.logs.ledger import Ledger
from gridslam.logs.mcap_file import McapFile
from gridslam.logs.ros_source import RosSource


def open_mcap(path: Path, config: LogConfig) -> RosSource:
    """Open and survey an MCAP file."""
    ledger = Ledger()
    file = McapFile(path, ledger, config.limits.chunk_mb << 20)
    source = RosSource(file, [path], config, ledger, "MCAP")
    source.compression = ", ".join(sorted(file.compressions)) or "none"
    return source
