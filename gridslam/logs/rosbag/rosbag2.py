"""rosbag2 recordings: a .db3 file alone, or a folder with metadata.yaml and .db3 or .mcap files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from gridslam.config.errors import short
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError, LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.csv.row import path_inside
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Container, Schema
from gridslam.logs.ros.source import RosSource
from gridslam.logs.rosbag.database import DatabaseFile

_SQLITE_MAGIC = b"SQLite format 3\0"


class Recordings:
    """Several files, one after the other, as one container."""

    def __init__(self, parts: Sequence[Container]) -> None:
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
    recording = _metadata_of(path) if path.is_dir() else {}
    files = _files_of(path, recording, message_counts) if path.is_dir() else [path]
    parts: list[DatabaseFile | McapFile] = []
    for file in files:
        with file.open("rb") as stream:
            is_database = stream.read(len(_SQLITE_MAGIC)) == _SQLITE_MAGIC
        parts.append(
            DatabaseFile(file, message_counts, limit_bytes)
            if is_database
            else McapFile(file, message_counts, limit_bytes)
        )
    container = parts[0] if len(parts) == 1 else Recordings(parts)
    files = [
        file for part in parts for file in (part.files if isinstance(part, DatabaseFile) else [part.path])
    ]
    source = RosSource(
        container, files, config=config, message_counts=message_counts, name="rosbag2", compression="none"
    )
    if path.is_dir():
        source.files.append(path / "metadata.yaml")
        _count_missing(recording, source, message_counts)
    packed = [name for part in parts if isinstance(part, McapFile) for name in part.compressions]
    source.compression = ", ".join(sorted(set(packed))) or "none"
    return source


def _metadata_of(folder: Path) -> dict[str, Any]:
    """The section of metadata.yaml that describes the recording."""
    if path_inside(folder, "metadata.yaml") is None:
        raise LogError(
            f"{folder / 'metadata.yaml'}: a link that leads out of the folder; put a copy in its place"
        )
    try:
        metadata = read_yaml(folder / "metadata.yaml").get("rosbag2_bagfile_information")
    except ConfigError as error:
        raise LogError(str(error)) from None
    if not isinstance(metadata, dict):
        raise LogError(f"{folder / 'metadata.yaml'}: no rosbag2_bagfile_information in it")
    if metadata.get("compression_mode"):
        raise LogError(f"{folder}: compressed as a whole; unpack it first with `ros2 bag convert`")
    return metadata


def _files_of(folder: Path, metadata: dict[str, Any], message_counts: MessageCounts) -> list[Path]:
    """The recordings that metadata.yaml names, all of them inside the folder, each once."""
    names = metadata.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise LogError(f"{folder / 'metadata.yaml'}: relative_file_paths names no file")
    files: dict[Path, None] = {}
    for name in dict.fromkeys(map(str, names)):
        path = path_inside(folder, name)
        if path is None or not path.is_file():
            raise LogError(f"{folder / 'metadata.yaml'}: {short(name)} is no file in this folder")
        files[path] = None
    if len(files) < len(names):
        message_counts.note(
            f"metadata.yaml: relative_file_paths names {len(names)} files, of which {len(files)} differ; each is read once"
        )
    return list(files)


def _count_missing(metadata: dict[str, Any], source: RosSource, message_counts: MessageCounts) -> None:
    """Count the messages that metadata.yaml promises and the files lack."""
    promised = metadata.get("message_count")
    if isinstance(promised, int) and source.message_count < promised:
        missing = promised - source.message_count
        message_counts.lose("messages", f"metadata.yaml, which counts {promised}", missing)
