"""ROS 1 bags, read by the library rosbags; their messages are converted to CDR and then decoded as those of ROS 2."""

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
from gridslam.logs.ros.definitions import is_valid
from gridslam.logs.ros.source import RosSource
from gridslam.logs.ros.types import MAX_SCHEMA_BYTES, ros2_types

_UNREADABLE = (("", (0, "")),)  # fields that are no valid ones
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
        """The message in CDR; empty, which counts as undecodable, where it cannot be converted."""
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError

        try:
            return bytes(self._store.ros1_to_cdr(raw, name))
        except (SerdeError, TypesysError, MemoryError, *_DAMAGE):
            return b""


def _types_of(connections: Iterable[Any]) -> Any:
    """The bag's own types, with ROS 2's header: in CDR there is no `seq`.

    A type whose definition in the bag is wrong is missing: its messages cannot be converted to CDR, and are counted then.
    """
    from rosbags.typesys import Stores, get_typestore

    types = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
    wrong: set[str] = set()
    valid: dict[str, Any] = {}
    for connection in connections:
        for name, (_, fields) in _definitions(connection).items():
            if is_valid(name, fields):
                valid[name] = ([], fields)
            else:
                wrong.add(name)
    types = {name: definition for name, definition in types.items() if name not in wrong} | valid
    types["std_msgs/msg/Header"] = ros2_types().fielddefs["std_msgs/msg/Header"]
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def _definitions(connection: Any) -> dict[str, Any]:
    """The types in the definition of a connection; the connection's own without fields where it cannot be parsed."""
    from rosbags.typesys import TypesysError, get_types_from_msg

    text = connection.msgdef.data
    if len(text) <= MAX_SCHEMA_BYTES:
        with suppress(TypesysError, KeyError, ValueError, RecursionError):
            return dict(get_types_from_msg(text, connection.msgtype))
    return {connection.msgtype: ([], _UNREADABLE)}


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
