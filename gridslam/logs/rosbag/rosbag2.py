"""rosbag2 recordings: a file alone, or the parts in a folder, with or without metadata.yaml; packed ones too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from gridslam.config.errors import short
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError, LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.encoding.csv_row import path_inside
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.container import Channel, Container, Schema
from gridslam.logs.ros.source import RosSource
from gridslam.logs.rosbag.database import DatabaseFile
from gridslam.logs.rosbag.packed import ZSTD_MAGIC, PackedMessages, UnpackedFile, is_packed
from gridslam.logs.rosbag.parts import recorded_parts

_SQLITE_MAGIC = b"SQLite format 3\0"
_METADATA = "metadata.yaml"


class Recordings:
    """Several files, one after the other, as one container."""

    def __init__(self, parts: Sequence[Container]) -> None:
        self._parts = parts
        self._numbers: dict[tuple[str, str], int] = {}
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._reading: Container | None = None

    @property
    def arrival_ns(self) -> int | None:
        """Time of arrival (ns) of the last message that was yielded; None if unknown."""
        return None if self._reading is None else self._reading.arrival_ns

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """(channel, data); channels of one topic and type have one number in all files."""
        for part in self._parts:
            numbers: dict[int, int] = {}
            self._reading = part
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
    """Open and index a rosbag2 folder or a single file, which may be packed as a whole."""
    message_counts = MessageCounts()
    limit_bytes = config.limits.chunk_mb << 20
    recording = _metadata_of(path) if (path / _METADATA).is_file() else {}
    files = _files_of(path, recording, message_counts) if path.is_dir() else [path]
    parts = [_Part(file, message_counts, limit_bytes) for file in files]
    parts = _by_time(parts, message_counts)
    container: Container = (
        parts[0].container if len(parts) == 1 else Recordings([part.container for part in parts])
    )
    if str(recording.get("compression_mode", "")).upper() == "MESSAGE" or parts[0].has_packed_messages():
        container = PackedMessages(container, limit_bytes)
    source = RosSource(
        container,
        [file for part in parts for file in part.files],
        config=config,
        message_counts=message_counts,
        name="rosbag2",
        compression="none",
        kept=parts,
    )
    if recording:
        source.files.append(path / _METADATA)
        _count_missing(recording, source, message_counts)
    packed = {name for part in parts for name in part.compressions}
    packed |= {"zstd"} if isinstance(container, PackedMessages) else set()
    source.compression = ", ".join(sorted(packed)) or "none"
    return source


class _Part:
    """One file of a recording. `files` are what it was read from."""

    def __init__(self, path: Path, message_counts: MessageCounts, limit_bytes: int) -> None:
        self._unpacked = UnpackedFile(path) if is_packed(path) else None
        opened = path if self._unpacked is None else self._unpacked.path
        with opened.open("rb") as stream:
            is_database = stream.read(len(_SQLITE_MAGIC)) == _SQLITE_MAGIC
        self.path = path
        self.container: DatabaseFile | McapFile = (
            DatabaseFile(opened, message_counts, limit_bytes)
            if is_database
            else McapFile(opened, message_counts, limit_bytes)
        )
        self.files = [path]
        if isinstance(self.container, DatabaseFile) and self._unpacked is None:
            self.files = self.container.files

    @property
    def compressions(self) -> set[str]:
        """Names of the compressions in use; those of chunks are known after reading."""
        chunks = set(self.container.compressions) if isinstance(self.container, McapFile) else set()
        return chunks if self._unpacked is None else chunks - {"none"} | {"zstd"}

    def has_packed_messages(self) -> bool:
        """Whether the first message of a database is compressed with zstd."""
        if isinstance(self.container, McapFile):
            return False
        return next((data[:4] == ZSTD_MAGIC for _, data in self.container.messages()), False)


def _by_time(parts: list[_Part], message_counts: MessageCounts) -> list[_Part]:
    """The parts in the order in which they were recorded; as they are where one does not say when it began."""
    if len(parts) < 2:
        return parts
    spans = [part.container.span_ns for part in parts]
    known = [span[0] for span in spans if span is not None]
    if len(known) < len(parts) or sorted(known) == known:
        return parts
    message_counts.find("the parts of the recording are named in another order than recorded: sorted by time")
    return [part for _, part in sorted(zip(known, parts, strict=True), key=lambda pair: pair[0])]


def _metadata_of(folder: Path) -> dict[str, Any]:
    """The section of metadata.yaml that describes the recording."""
    if path_inside(folder, _METADATA) is None:
        raise LogError(
            f"{folder / 'metadata.yaml'}: a link that leads out of the folder; put a copy in its place"
        )
    try:
        metadata = read_yaml(folder / _METADATA).get("rosbag2_bagfile_information")
    except ConfigError as error:
        raise LogError(str(error)) from None
    if not isinstance(metadata, dict):
        raise LogError(f"{folder / 'metadata.yaml'}: no rosbag2_bagfile_information in it")
    return metadata


def _files_of(folder: Path, metadata: dict[str, Any], message_counts: MessageCounts) -> list[Path]:
    """The recordings that metadata.yaml names, all of them inside the folder, each once; without it, all parts."""
    if not metadata:
        files = recorded_parts(folder)
        if not files:
            raise LogError(f"{folder / _METADATA}: says nothing of a recording, and the folder has none")
        message_counts.note(
            f"{_METADATA} is missing: {', '.join(file.name for file in files[:8])} read one after the other"
        )
        return files
    names = metadata.get("relative_file_paths")
    if not isinstance(names, list) or not names:
        raise LogError(f"{folder / _METADATA}: relative_file_paths names no file")
    found: dict[Path, None] = {}
    for name in dict.fromkeys(map(str, names)):
        path = path_inside(folder, name)
        if path is None or not path.is_file():
            # Older recorders wrote the folder's name before the file's
            path = path_inside(folder, Path(name).name)
        if path is None or not path.is_file():
            raise LogError(
                f"{folder / _METADATA}: {short(name)} is not a file in this folder: put it there, or take it "
                "out of relative_file_paths to do without it"
            )
        found[path] = None
    if len(found) < len(names):
        message_counts.note(
            f"{_METADATA}: relative_file_paths names {len(names)} files, of which {len(found)} differ; each is read once"
        )
    return list(found)


def _count_missing(metadata: dict[str, Any], source: RosSource, message_counts: MessageCounts) -> None:
    """Count the messages that metadata.yaml promises and the files lack."""
    promised = metadata.get("message_count")
    if isinstance(promised, int) and source.message_count < promised:
        missing = promised - source.message_count
        message_counts.lose("messages", f"{_METADATA}, which counts {promised}", missing)
