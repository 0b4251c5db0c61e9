"""ROS 1 bags, read by the library rosbags; their messages are converted to CDR and then decoded as those of ROS 2."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Schema
from gridslam.logs.ros.ros1 import Ros1Types, is_used
from gridslam.logs.ros.source import RosSource
from gridslam.logs.ros.types import MAX_DEFINITIONS

_DAMAGE = (OSError, ValueError, KeyError, IndexError, AssertionError, struct.error, RuntimeError, EOFError)


class Ros1Bag:
    """The messages of a .bag file by their time of arrival."""

    def __init__(self, path: Path, message_counts: MessageCounts) -> None:
        from rosbags.rosbag1 import Reader, ReaderError

        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.arrival_ns: int | None = None
        self._message_counts = message_counts
        self._is_indexed = False
        try:
            with Reader(path) as reader:
                connections = list(reader.connections)
        except (ReaderError, *_DAMAGE) as error:
            raise LogError(
                f"{path}: not a readable ROS 1 bag ({error}); `rosbag reindex` may repair it"
            ) from error
        definitions = dict.fromkeys((c.msgtype, c.msgdef.data) for c in connections if is_used(c.msgtype))
        self._types = Ros1Types(islice(definitions, MAX_DEFINITIONS))
        for connection in connections:
            self.channels[connection.id] = Channel(connection.topic, "cdr", connection.id)
            self.schemas[connection.id] = self._types.schema_of(connection.msgtype)

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(connection, data in CDR) of every readable message; data of unused types are not converted."""
        from rosbags.rosbag1 import Reader, ReaderError

        read = 0
        try:
            with Reader(self.path) as reader:
                for connection, arrival, raw in reader.messages():
                    read += 1
                    self.arrival_ns = int(arrival)
                    is_wanted = is_used(connection.msgtype)
                    yield connection.id, self._types.to_cdr(raw, connection.msgtype) if is_wanted else raw
        except (ReaderError, *_DAMAGE) as error:
            if not self._is_indexed:
                self._message_counts.lose("rest_of_bag", f"{self.path.name} after message {read} ({error})")
        self._is_indexed = True


def open_rosbag1(path: Path, config: LogConfig) -> RosSource:
    """Open and index a ROS 1 bag."""
    message_counts = MessageCounts()
    return RosSource(
        Ros1Bag(path, message_counts),
        [path],
        config=config,
        message_counts=message_counts,
        name="ROS 1 bag",
        compression="none",
    )
