"""ROS 1 bags, through rosbags; their messages are turned into CDR and then treated as those of ROS 2."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gridslam.core.errors import LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.ledger import Ledger
from gridslam.logs.mcap_file import Channel, Schema
from gridslam.logs.ros_source import RosSource

_DAMAGE = (OSError, ValueError, KeyError, IndexError, AssertionError, struct.error, RuntimeError, EOFError)


class Ros1Bag:
    """The messages of a .bag file by their time of arrival."""

    def __init__(self, path: Path, ledger: Ledger) -> None:
        from rosbags.rosbag1 import Reader, ReaderError
        from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._ledger = ledger
        self._surveyed = False
        self._reader = Reader(path)
        self._store: Any = get_typestore(Stores.ROS1_NOETIC)
        try:
            self._reader.open()
        except (ReaderError, *_DAMAGE) as error:
            raise LogError(
                f"{path}: not a readable ROS 1 bag ({error}); `rosbag reindex` may repair it"
            ) from error
        for connection in self._reader.connections:
            name = connection.msgtype
            self.channels[connection.id] = Channel(connection.topic, "cdr", connection.id)
            self.schemas[connection.id] = Schema(name, "", b"")
            if name not in self._store.fielddefs:
                try:
                    self._store.register(get_types_from_msg(connection.msgdef.data, name))
                except TypesysError:
                    continue  # a message of such a type cannot be turned into CDR and is counted then

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(connection, data in CDR) of every readable message."""
        from rosbags.rosbag1 import ReaderError

        read = 0
        try:
            for connection, _, raw in self._reader.messages():
                read += 1
                yield connection.id, self._to_cdr(raw, connection.msgtype)
        except (ReaderError, *_DAMAGE) as error:
            if not self._surveyed:
                self._ledger.lose("rest_of_bag", f"{self.path.name} after message {read} ({error})")
        self._surveyed = True

    def _to_cdr(self, raw: bytes, name: str) -> bytes:
        """The message in CDR; no bytes (which count as undecodable) where it cannot be had."""
        from rosbags.serde import SerdeError

        try:
            return bytes(self._store.ros1_to_cdr(raw, name))
        except (SerdeError, *_DAMAGE):
            return b""


def open_rosbag1(path: Path, config: LogConfig) -> RosSource:
    """Open and survey a ROS 1 bag."""
    ledger = Ledger()
    return RosSource(Ros1Bag(path, ledger), [path], config, ledger, "ROS 1 bag", "none")
