"""Tables as a source of streams: a folder of CSV files, or the data sets of an HDF5 file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from pydantic import ValidationError

from gridslam.config.errors import config_error
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import LogError
from gridslam.core.files import real_path
from gridslam.core.messages import Event, Transform
from gridslam.logs import rotations
from gridslam.logs.config import LogConfig
from gridslam.logs.csv.table import CsvTable
from gridslam.logs.csv_layout import CsvLayout, CsvStream, default_files
from gridslam.logs.encoding.csv_row import path_inside
from gridslam.logs.kinds import KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip
from gridslam.logs.streams import RecordedStream
from gridslam.logs.text import TextLines

LAYOUT_FILE = "log.yaml"
LOG_ENDINGS = (
    ".mcap",
    ".db3",
    ".bag",
    ".h5",
    ".hdf5",
    ".clf",
    ".clf.gz",
    ".clf.bz2",
    ".log",
    ".log.gz",
    ".log.bz2",
)
_MAX_NAMED = 5

OpenTable: TypeAlias = Callable[[CsvStream], tuple[Path, Iterable[tuple[int, bytes]]]]  # its place, its lines


class TableSource:
    """Tables as streams. `open_table` returns the lines of a table, `files` are the files read, `layout` describes the tables."""

    compression = "none"
    order: Literal["recorded", "stamp"] = "recorded"

    def __init__(
        self,
        name: str,
        path: Path,
        layout: CsvLayout,
        open_table: OpenTable,
        message_counts: MessageCounts,
        files: Sequence[Path],
    ) -> None:
        self.format = name
        self.message_counts = message_counts
        self.streams: list[RecordedStream] = []
        self.static_edges: list[Transform] = []
        self.files = list(files)
        self._path = path
        self._tables: list[CsvTable] = []
        for stream in layout.streams:
            self._add(stream, open_table)
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

    def _add(self, stream: CsvStream, open_table: OpenTable) -> None:
        path, lines = open_table(stream)
        table = CsvTable(self._path, path, stream, self.message_counts, lines)
        stamps, frames = table.index()
        kind = KINDS[stream.kind]
        moves_base = kind.is_event and kind.csv is not None and "child_frame" in kind.csv.optional
        child = (stream.child_frame or "base_link") if moves_base else ""
        detail = ""
        if kind.message is Transform and len(edge := table.edges()) == 1:
            (parent, child), frames = edge.pop(), {}
            frames[parent], detail = None, f"{parent}->{child}"
        self._tables.append(table)
        topic = stream.topic or stream.file
        self.streams.append(
            RecordedStream(
                stream.kind, topic, "CSV", detail=detail, stamps_ns=stamps, frames=frames, child_frame=child
            )
        )
        if path.is_file() and path not in self.files:
            self.files.append(path)

    def _add_extrinsics(self, layout: CsvLayout) -> None:
        base = layout.base_frame or next((s.child_frame for s in self.streams if s.child_frame), "base_link")
        for frame, m in layout.extrinsics.items():
            rotation = m.quat_wxyz or rotations.from_euler(m.roll, m.pitch, m.yaw)
            self.static_edges.append(
                Transform(0, m.parent or base, frame, (m.x, m.y, m.z), rotation, is_static=True)
            )


def open_csv_folder(folder: Path, config: LogConfig) -> TableSource:
    """One stream per file, by log.yaml (in the folder, or given by the config) or by the default file names."""
    counts = MessageCounts()
    files = [config.csv] if isinstance(config.csv, Path) and config.csv.parent == folder else []
    layout = given_layout(config) or CsvLayout()
    if config.csv is None and (own := folder / LAYOUT_FILE).is_file():
        if path_inside(folder, LAYOUT_FILE) is None:
            raise LogError(f"{own}: a link that leads out of the log's folder; put a copy in its place")
        layout, files = _read_layout(own), [own]
    if "streams" not in layout.model_fields_set:
        layout = layout.model_copy(update={"streams": _found_streams(folder)})

    def lines_of(stream: CsvStream) -> tuple[Path, TextLines]:
        path = path_inside(folder, stream.file)
        if path is None:
            raise LogError(f"{folder / LAYOUT_FILE}: {stream.file!r} lies outside the log's folder")
        if not path.is_file():
            raise LogError(f"{folder / stream.file}: no such file, which {LAYOUT_FILE} names")
        return path, TextLines(path, counts, config.limits.line_mb << 20)

    return TableSource(
        name="CSV folder", path=folder, layout=layout, open_table=lines_of, message_counts=counts, files=files
    )


def open_table(path: Path, config: LogConfig) -> TableSource:
    """A single table, whose columns the layout of the config names. Raises LogError: the layout names other files."""
    layout = given_layout(config)
    files = [stream.file for stream in layout.streams] if layout else []
    if not any(path_inside(path.parent, name) == real_path(path) for name in files):
        named = ", ".join(files[:_MAX_NAMED]) or "no file"
        raise LogError(
            f"{path}: no log of a known format, and the layout of tables (log.csv) names {named}, not this file"
        )
    return open_csv_folder(path.parent, config)


def open_hdf5(path: Path, config: LogConfig) -> TableSource:
    """One stream per group or data set of an HDF5 file, by the layout of the config or by groups named like kinds."""
    from gridslam.logs.csv.hdf5_rows import Hdf5Rows, columns_of, streams_of

    columns = columns_of(path)
    layout = given_layout(config) or CsvLayout()
    if "streams" not in layout.model_fields_set:
        layout = layout.model_copy(update={"streams": streams_of(path, columns)})

    def lines_of(stream: CsvStream) -> tuple[Path, Hdf5Rows]:
        return path / stream.file.strip("/"), Hdf5Rows(path, stream, columns)

    return TableSource(
        name="HDF5",
        path=path,
        layout=layout,
        open_table=lines_of,
        message_counts=MessageCounts(),
        files=[path],
    )


def given_layout(config: LogConfig) -> CsvLayout | None:
    """The layout of tables that the config gives, or names by its path."""
    if config.csv is None or isinstance(config.csv, CsvLayout):
        return config.csv
    return _read_layout(config.csv)


def _read_layout(path: Path) -> CsvLayout:
    try:
        return CsvLayout.model_validate(read_yaml(path))
    except ValidationError as error:
        raise config_error(error, CsvLayout, str(path)) from None


def _found_streams(folder: Path) -> list[CsvStream]:
    """The streams of a folder without log.yaml: the files with the default names."""
    found: dict[str, CsvStream] = {}
    for name, kind in default_files().items():
        if kind not in found and (folder / name).is_file():
            found[kind] = CsvStream(kind=kind, file=name)
    if not found:
        raise LogError(
            f"{folder}: no log: neither {LAYOUT_FILE} nor one of {', '.join(default_files())} is in it"
        )
    return list(found.values())
