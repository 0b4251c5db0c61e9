"""rosbag2 recordings: a .db3 file (SQLite), or the folder with metadata.yaml around .db3 or .mcap files."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from gridslam.config.errors import short
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError, LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.csv.row import path_inside
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Container, Schema
from gridslam.logs.ros.source import RosSource
from gridslam.logs.ros.types import full_name

_SQLITE_MAGIC = b"SQLite format 3\0"


class Db3File:
    """The messages of a .db3 file, in the order in which they were written."""

    def __init__(self, path: Path, message_counts: MessageCounts, limit_bytes: int) -> None:
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._message_counts = message_counts
        self._limit = limit_bytes
        self._is_indexed = False
        try:
            with closing(self._connect()) as database:
                definitions = self._definitions(database)
                for number, name, kind, encoding in database.execute(
                    "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
                ):
                    self.channels[number] = Channel(str(name), str(encoding), number)
                    text_encoding, text = definitions.get(str(kind), ("", ""))
                    self.schemas[number] = Schema(full_name(str(kind)), text_encoding, text.encode())
        except sqlite3.Error as error:
            raise LogError(f"{path}: not a readable rosbag2 database ({error})") from error

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(topic id, data) of every readable message."""
        read = 0
        try:
            with closing(self._connect()) as database:
                for channel, data in database.execute("SELECT topic_id, data FROM messages ORDER BY id"):
                    read += 1
                    if isinstance(data, bytes) and len(data) <= self._limit:
                        yield channel, data
                    elif not self._is_indexed:
                        self._message_counts.lose("too_large_record", f"{self.path.name} message {read}")
        except sqlite3.Error as error:
            if not self._is_indexed:
                self._message_counts.lose(
                    "rest_of_database", f"{self.path.name} after message {read} ({error})"
                )
        self._is_indexed = True

    def _connect(self) -> sqlite3.Connection:
        return sqlite3.connect(f"{self.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)

    @staticmethod
    def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
        """Definitions by type: newer recorders store them, older ones do not."""
        tables = {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if "message_definitions" not in tables:
            return {}
        rows = database.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        return {str(kind): (str(encoding), str(text)) for kind, encoding, text in rows}


class Recordings:
    """Several files, one after the other, as one container."""

    def __init__(self, parts: list[Container]) -> None:
        self._parts = parts
        self._numbers: dict[tuple[str, str], int] = {}
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel, data); channels of one topic and type have one number in all files."""
        for part in self._parts:
            numbers: dict[int, int] = {}
            for channel, data in part.messages():
                number = numbers.get(channel)
                if number is None:
                    number = numbers[channel] = self._number(part, channel)
                yield number, data

    def _number(self, part: Container, channel: int) -> int:
        described = part.channels.get(channel)
        if described is None:
            return -1
        schema = part.schemas.get(described.schema_id)
        key = described.topic, schema.name if schema else ""
        if key not in self._numbers:
            number = self._numbers[key] = len(self._numbers)
            self.channels[number] = Channel(described.topic, described.encoding, number)
            if schema is not None:
                self.schemas[number] = schema
        return self._numbers[key]


def open_rosbag2(path: Path, config: LogConfig) -> RosSource:
    """Open and index a rosbag2 folder or a single .db3 file."""
    message_counts = MessageCounts()
    limit_bytes = config.limits.chunk_mb << 20
    files = _files_of(path) if path.is_dir() else [path]
    parts: list[Container] = []
    for file in files:
        with file.open("rb") as stream:
            is_database = stream.read(len(_SQLITE_MAGIC)) == _SQLITE_MAGIC
        parts.append(
            Db3File(file, message_counts, limit_bytes)
            if is_database
            else McapFile(file, message_counts, limit_bytes)
        )
    container = parts[0] if len(parts) == 1 else Recordings(parts)
    source = RosSource(container, files, config, message_counts, "rosbag2", "none")
    if path.is_dir():
        source.files.append(path / "metadata.yaml")
    packed = [name for part in parts if isinstance(part, McapFile) for name in part.compressions]
    source.compression = ", ".join(sorted(set(packed))) or "none"
    return source


def _files_of(folder: Path) -> list[Path]:
    """The recordings that metadata.yaml names, all of them inside the folder."""
    try:
        metadata = read_yaml(folder / "metadata.yaml").get("rosbag2_bagfile_information")
    except ConfigError as error:
        raise LogError(str(error)) from None
    if not isinstance(metadata, dict):
        raise LogError(f"{folder / 'metadata.yaml'}: no rosbag2_bagfile_information in it")
    if metadata.get("compression_mode"):
        raise LogError(f"{folder}: compressed as a whole; unpack it first with `ros2 bag convert`")
    names = metadata.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise LogError(f"{folder / 'metadata.yaml'}: relative_file_paths names no file")
    files = []
    for name in names:
        path = path_inside(folder, str(name))
        if path is None or not path.is_file():
            raise LogError(f"{folder / 'metadata.yaml'}: {short(name)} is no file in this folder")
        files.append(path)
    return files
