"""A folder of CSV files as a source of streams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from gridslam.config.errors import config_error
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import LogError
from gridslam.core.messages import Event, Transform
from gridslam.logs import rotations
from gridslam.logs.config import LogConfig
from gridslam.logs.csv.layout import CsvLayout, CsvStream, default_files
from gridslam.logs.csv.row import path_inside
from gridslam.logs.csv.table import CsvTable
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip
from gridslam.logs.streams import RecordedStream

LAYOUT_FILE = "log.yaml"
LOG_ENDINGS = (".mcap", ".db3", ".bag", ".clf", ".clf.gz", ".clf.bz2", ".log", ".log.gz", ".log.bz2")
_MAX_NAMED = 5


class CsvSource:
    """One stream per file, by log.yaml (in the folder, or given by the config) or by the default file names."""

    format = "CSV folder"
    compression = "none"
    order: Literal["recorded", "stamp"] = "recorded"

    def __init__(self, folder: Path, config: LogConfig) -> None:
        self.message_counts = MessageCounts()
        self.streams: list[RecordedStream] = []
        self.static_edges: list[Transform] = []
        self.files: list[Path] = []
        self._tables: list[CsvTable] = []
        layout = self._layout(folder, config)
        for stream in layout.streams if "streams" in layout.model_fields_set else _found_streams(folder):
            self._add(folder, stream, config.limits.line_mb << 20)
        self.base_frame = layout.base_frame
        self._add_extrinsics(layout)

    def close(self) -> None:
        """Do nothing: no file stays open between passes."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Events in the order of `schedule`; each file is read from its start, line by line."""
        events = {index: self._tables[index].events() for index in wanted}
        for index in schedule:
            event = next(events[index], None)
            if event is not None:
                yield index, event

    def _layout(self, folder: Path, config: LogConfig) -> CsvLayout:
        if isinstance(config.csv, CsvLayout):
            return config.csv
        path = config.csv or folder / LAYOUT_FILE
        if config.csv is None and not path.is_file():
            return CsvLayout()
        if config.csv is None and path_inside(folder, LAYOUT_FILE) is None:
            raise LogError(f"{path}: a link that leads out of the log's folder; put a copy in its place")
        if path.parent == folder:
            self.files.append(path)
        try:
            return CsvLayout.model_validate(read_yaml(path))
        except ValidationError as error:
            raise config_error(error, CsvLayout, str(path)) from None

    def _add(self, folder: Path, stream: CsvStream, line_limit_bytes: int) -> None:
        path = path_inside(folder, stream.file)
        if path is None:
            raise LogError(f"{folder / LAYOUT_FILE}: {stream.file!r} lies outside the log's folder")
        if not path.is_file():
            raise LogError(f"{folder / stream.file}: no such file, which {LAYOUT_FILE} names")
        table = CsvTable(folder, path, stream, self.message_counts, line_limit_bytes)
        stamps, frames = table.index()
        child = (stream.child_frame or "base_link") if stream.kind == "odom" else ""
        detail = ""
        if stream.kind == "tf" and len(edge := table.edges()) == 1:
            (parent, child), frames = edge.pop(), {}
            frames[parent], detail = None, f"{parent}->{child}"
        self._tables.append(table)
        topic = stream.topic or stream.file
        self.streams.append(
            RecordedStream(
                stream.kind, topic, "CSV", detail=detail, stamps_ns=stamps, frames=frames, child_frame=child
            )
        )
        if path not in self.files:
            self.files.append(path)

    def _add_extrinsics(self, layout: CsvLayout) -> None:
        base = layout.base_frame or next((s.child_frame for s in self.streams if s.child_frame), "base_link")
        for frame, m in layout.extrinsics.items():
            rotation = m.quat_wxyz or rotations.from_euler(m.roll, m.pitch, m.yaw)
            self.static_edges.append(
                Transform(0, m.parent or base, frame, (m.x, m.y, m.z), rotation, is_static=True)
            )


def _found_streams(folder: Path) -> list[CsvStream]:
    """The streams of a folder without log.yaml: the files with the default names."""
    found: dict[str, CsvStream] = {}
    for name, kind in default_files().items():
        if kind not in found and (folder / name).is_file():
            found[kind] = CsvStream(kind=kind, file=name)
    if not found:
        raise LogError(
            f"{folder}: no log: neither {LAYOUT_FILE} nor one of {', '.join(default_files())} is in it"
            f"{_logs_inside(folder)}"
        )
    return list(found.values())


def _logs_inside(folder: Path) -> str:
    """A hint that names the logs in a folder, for somebody who gave the folder and meant one of them."""
    names = sorted(file.name for file in folder.iterdir() if file.name.endswith(LOG_ENDINGS))
    if not names:
        return ""
    more = f" and {len(names) - _MAX_NAMED} more" if len(names) > _MAX_NAMED else ""
    return f"; it holds {', '.join(names[:_MAX_NAMED])}{more}: name one of them"
