"""MCAP as a source of streams."""

from __future__ import annotations

from pathlib import Path

from gridslam.logs.config import LogConfig
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.ros1 import ENCODING, Ros1Messages
from gridslam.logs.ros.source import RosSource


def open_mcap(path: Path, config: LogConfig) -> RosSource:
    """Open and index an MCAP file."""
    message_counts = MessageCounts()
    file = McapFile(path, message_counts, config.limits.chunk_mb << 20)
    container = Ros1Messages(file) if file.profile == "ros1" or _has_ros1(file) else file
    source = RosSource(container, [path], config, message_counts, "MCAP")
    source.compression = ", ".join(sorted(file.compressions)) or "none"
    return source


def _has_ros1(file: McapFile) -> bool:
    """Whether the index names channels of ROS 1 messages."""
    return any(channel.encoding == ENCODING for channel in file.channels.values())
