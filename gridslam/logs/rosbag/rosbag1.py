"""ROS 1 bags, through rosbags; their messages are turned into CDR and then treated as those of ROS 2."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from gridslam.core.errors import LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Schema
from gridslam.logs.ros.source import RosSource
from gridslam.logs.ros.types import ros2_types

_DAMAGE = (OSError, ValueError, KeyError, IndexError, AssertionError, struct.error, RuntimeError, EOFError)


class Ros1Bag:
    """The messages of a .bag file by their time of arrival."""

    def __init__(self, path: Path, message_counts: MessageCounts) -> None:
        from rosbags.rosbag1 import Reader, ReaderError

        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._message_counts = message_counts
        self._is_indexed = False
        try:
            with Reader(path) as reader:
                connections = list(reader.connections)
        except (ReaderError, *_DAMAGE) as error:
            raise LogError(
                f"{path}: not a readable ROS 1 bag ({error}); `rosbag reindex` may repair it"
            ) from error
        self._store = _types_of(connections)
        for connection in connections:
            self.channels[connection.id] = Channel(connection.topic, "cdr", connection.id)
            self.schemas[connection.id] = Schema(connection.msgtype, "", b"")

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(connection, data in CDR) of every readable message."""
        from rosbags.rosbag1 import Reader, ReaderError

        read = 0
        try:
            with Reader(self.path) as reader:
                for connection, _, raw in reader.messages():
                    read += 1
                    yield connection.id, self._to_cdr(raw, connection.msgtype)
        except (ReaderError, *_DAMAGE) as error:
            if not self._is_indexed:
                self._message_counts.lose("rest_of_bag", f"{self.path.name} after message {read} ({error})")
        self._is_indexed = True

    def _to_cdr(self, raw: bytes, name: str) -> bytes:
        """The message in CDR; no bytes (which count as undecodable) where it cannot be had."""
        from rosbags.serde import SerdeError

        try:
            return bytes(self._store.ros1_to_cdr(raw, name))
        except (SerdeError, *_DAMAGE):
            return b""


def _types_of(connections: Iterable[Any]) -> Any:
    """The bag's own types, with ROS 2's header: in CDR there is no `seq`."""
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    types = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
    for connection in connections:
        with suppress(TypesysError):  # a message of such a type cannot be turned into CDR and is counted then
            types.update(get_types_from_msg(connection.msgdef.data, connection.msgtype))
    types["std_msgs/msg/Header"] = ros2_types().fielddefs["std_msgs/msg/Header"]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def open_rosbag1(path: Path, config: LogConfig) -> RosSource:
    """Open and index a ROS 1 bag."""
    message_counts = MessageCounts()
    return RosSource(Ros1Bag(path, message_counts), [path], config, message_counts, "ROS 1 bag", "none")
