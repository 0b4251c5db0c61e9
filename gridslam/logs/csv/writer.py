"""Write events as a folder of CSV files, with a log.yaml that describes them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import yaml

from gridslam.core.errors import LogError
from gridslam.core.files import identity_of, partial_folder, put_folder, real_path
from gridslam.core.messages import Event, Odometry, Transform
from gridslam.core.stamps import END_NS, format_stamp
from gridslam.core.texts import is_storable
from gridslam.logs.csv.source import LAYOUT_FILE
from gridslam.logs.csv.written_folder import check_csv_free
from gridslam.logs.csv_layout import MAX_TABLES
from gridslam.logs.encoding.csv_fields import name_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.kind_lookup import kind_of_event
from gridslam.logs.kinds import CSV_KINDS, PRECEDENCE, TRUTH_TOPIC, WITHOUT_TABLE
from gridslam.logs.message_kind import CsvTableKind

_FRAMES = ("frame", "child_frame")  # columns that a table has only where its rows name their frames


@dataclass(slots=True)
class _TableFile:
    """One open CSV file and its entry in log.yaml."""

    path: Path
    stream: IO[str]
    writer: Any
    layout: dict[str, str]
    frames: dict[str, str]  # those of the first row, by column
    place: int  # of the frames among the columns
    rows_name_frames: bool = False
    last_group: tuple[int, str] | None = None  # stamp and grouping column, where the last row has an item


class CsvFolderWriter:
    """Writes events into a folder that gets its name when `close` succeeds; the same events give the same bytes.

    Raises ConfigError as `check_csv_free` does. LogError for an event that would not read back as it is.
    """

    def __init__(self, path: str | Path, force: bool = False) -> None:
        self._path = real_path(Path(path))
        self._force = force
        check_csv_free(Path(path), force)
        self._aside = ExitStack()
        self._before = identity_of(self._path)
        self._folder = self._aside.enter_context(partial_folder(self._path))
        self._pictures = PictureWriter(self._folder)
        self._files: dict[tuple[str, ...], _TableFile] = {}
        self._tables_of: dict[str, int] = {}  # number by kind
        self._extrinsics: dict[str, dict[str, object]] = {}
        self._base_frames: dict[str, str] = {}  # by the kind of stream that names the robot's frame
        self._closed = False

    def __enter__(self) -> CsvFolderWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._closed = True
            self._aside.__exit__(kind, error, trace)

    def write(self, event: Event, topic: str | None = None) -> None:
        """Append one event. `topic` keeps two streams of one kind apart."""
        if not 0 <= event.stamp_ns < END_NS:
            raise LogError(
                f"stamp {event.stamp_ns} ns of a {type(event).__name__} cannot be written: 0 to 2^31 s can"
            )
        _refuse_unwritable(event, topic)
        if (parts_of := kind_of_event(event).csv_parts) is not None:
            for part, its_topic in parts_of(event, topic):
                self.write(part, its_topic)
        elif isinstance(event, Transform) and event.is_static:
            self._write_extrinsics(event)
        else:
            is_truth = topic == TRUTH_TOPIC and isinstance(event, Odometry)
            kind = "truth" if is_truth else kind_of_event(event).name
            self._append(kind, event, topic)

    def write_truth(self, pose: Odometry) -> None:
        """Append a true pose to truth.csv."""
        self.write(pose, TRUTH_TOPIC)

    def complete(self) -> None:
        """Write the rest of the log under its temporary name. Nothing may be appended afterwards."""
        for file in self._files.values():
            file.stream.close()
        layout: dict[str, object] = {"version": 1}
        by_kind = sorted(self._base_frames, key=PRECEDENCE.__getitem__)
        if base_frame := next(filter(None, map(self._base_frames.get, by_kind)), None):
            layout["base_frame"] = base_frame
        layout["streams"] = [file.layout for file in self._files.values()]
        if self._extrinsics:
            layout["extrinsics"] = self._extrinsics
        text = yaml.safe_dump(layout, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
        (self._folder / LAYOUT_FILE).write_text(text, encoding="utf-8")

    def close(self) -> None:
        """Complete the folder, and give it its final name."""
        if self._closed:
            return
        self._closed = True
        with self._aside:
            self.complete()
            check_csv_free(self._path, self._force)
            put_folder(self._folder, self._path, self._before)

    def abandon(self) -> None:
        """Remove what was written."""
        self._closed = True
        with suppress(OSError):  # what a full disk did not take is given up anyway
            self._aside.close()

    def _write_extrinsics(self, transform: Transform) -> None:
        x, y, z = transform.translation_m
        entry: dict[str, object] = {"x": x, "y": y, "z": z, "quat_wxyz": list(transform.quat_wxyz)}
        entry["parent"] = transform.frame_id
        self._extrinsics[transform.child_frame_id] = entry

    def _append(self, kind: str, event: Any, topic: str | None) -> None:
        table = CSV_KINDS[kind]
        key = (kind, topic or "", *(getattr(event, name) for name in table.apart_by))
        file = self._files.get(key)
        if file is None:
            file = self._files[key] = self._open(kind, event, topic)
        frames = _frames(kind, event)
        if frames != file.frames and not file.rows_name_frames:
            self._name_frames(file)
        rows = table.to_rows(event, self._pictures)
        if table.groups is not None:
            _refuse_to_join(file, table, event, rows[0])
        for fields in rows:
            row = [format_stamp(event.stamp_ns), *fields]
            if file.rows_name_frames:
                row[file.place : file.place] = map(name_field, frames.values())
            file.writer.writerow(row)

    def _open(self, kind: str, event: Any, topic: str | None) -> _TableFile:
        if len(self._files) >= MAX_TABLES:
            raise LogError(
                f"more than {MAX_TABLES} streams, as many as a CSV folder can have tables; name the output OUT.mcap, or choose "
                "streams with --topics"
            )
        number = self._tables_of[kind] = self._tables_of.get(kind, 0) + 1
        name = f"{kind}.csv" if number == 1 else f"{kind}_{number}.csv"
        frames = _frames(kind, event)
        table = CSV_KINDS[kind]
        if "child_frame" in table.optional and not self._base_frames.get(kind):
            self._base_frames[kind] = event.child_frame_id
        path = self._folder / name
        stream = self._aside.enter_context(path.open("w", encoding="utf-8", newline=""))
        layout = {"kind": kind, "file": name, **({"topic": topic} if topic else {}), "frame": "", **frames}
        columns = ["stamp", *table.required, *(c for c in table.optional if c not in _FRAMES)]
        file = _TableFile(
            path,
            stream,
            csv.writer(stream, lineterminator="\n"),
            layout=layout,
            frames=frames,
            place=len(columns),
        )
        if table.rows_name_frames and "frame" in table.optional:
            columns.append("frame")
        if table.has_ranges:
            columns += [f"r{i}" for i in range(len(event.ranges_m))]
        file.writer.writerow(columns)
        return file

    def _name_frames(self, file: _TableFile) -> None:
        """Write a file again with its frames as columns, since the frames of the stream differ from here on."""
        file.stream.close()
        before = file.path.rename(file.path.with_suffix(".before"))
        file.stream = self._aside.enter_context(file.path.open("w", encoding="utf-8", newline=""))
        file.writer = csv.writer(file.stream, lineterminator="\n")
        with before.open(encoding="utf-8", newline="") as rows:
            fields: Iterable[str] = file.frames
            for row in csv.reader(rows):
                row[file.place : file.place] = fields
                file.writer.writerow(row)
                fields = [name_field(frame) for frame in file.frames.values()]
        before.unlink()
        file.layout.update(dict.fromkeys(file.frames, ""))  # of the rows whose field is empty
        file.rows_name_frames = True


def _refuse_unwritable(event: Event, topic: str | None) -> None:
    """Raises LogError for an event without a table, and for a name that log.yaml cannot hold."""
    kind = kind_of_event(event).name
    if kind in WITHOUT_TABLE:
        raise LogError(f"a {type(event).__name__} has no CSV table; name the output OUT.mcap")
    for name in (topic or "", event.frame_id, getattr(event, "child_frame_id", "")):
        if not is_storable(name):
            raise LogError(
                f"the name {name!r} cannot be written to a CSV folder, whose log.yaml holds no zero and no half character"
            )


def _frames(kind: str, event: Any) -> dict[str, str]:
    """The frames of an event by column; empty for kinds whose rows name their frames anyway."""
    if CSV_KINDS[kind].rows_name_frames:
        return {}
    return {
        column: getattr(event, f"{column}_id") for column in _FRAMES if column in CSV_KINDS[kind].optional
    }


def _refuse_to_join(file: _TableFile, table: CsvTableKind, event: Event, row: Sequence[str]) -> None:
    """Raises LogError for an event that would read back as a part of the one before; `row` is its first."""
    assert table.groups is not None
    by, item = (row[table.required.index(column)] for column in table.groups)
    this = (event.stamp_ns, by) if item else None
    if this is not None and this == file.last_group:
        raise LogError(
            f"two messages of {table.groups.by} {by!r} with stamp {format_stamp(event.stamp_ns)}: "
            f"rows of one stamp and {table.groups.by} are one message in a CSV file; name the output OUT.mcap"
        )
    file.last_group = this
