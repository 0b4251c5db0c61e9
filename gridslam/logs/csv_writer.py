"""Write events as a folder of CSV files with a log.yaml that says how to read them."""

from __future__ import annotations

import csv
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import yaml

from gridslam.core.errors import ConfigError, LogError
from gridslam.core.messages import (
    Event,
    Image,
    Odometry,
    StereoPair,
    Transform,
)
from gridslam.logs.csv_rows import ROWS
from gridslam.logs.csv_source import LAYOUT_FILE
from gridslam.logs.layout import COLUMNS
from gridslam.logs.stamps import END_NS, format_stamp
from gridslam.logs.streams import KIND_OF_EVENT
from gridslam.logs.write import TRUTH_TOPIC

_MANY_FRAMES = frozenset({"tags", "image", "depth", "disparity", "camera_info"})


@dataclass(slots=True)
class _File:
    """One open CSV file and what log.yaml will say of it."""

    stream: IO[str]
    writer: Any
    layout: dict[str, str]
    columns: int = 0
    rows: int = 0


@dataclass(slots=True)
class _Files:
    """The files written so far, by what makes a stream of its own: kind, topic and frames."""

    by_key: dict[tuple[str, ...], _File] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)


class CsvFolderWriter:
    """Events in, one folder out, which has its name only when `close` succeeds; same events, same bytes."""

    def __init__(self, path: str | Path, force: bool = False) -> None:
        self._path = Path(path)
        self._force = force
        try:
            self._folder = Path(tempfile.mkdtemp(prefix=f".{self._path.name}.", dir=self._path.parent))
        except OSError as error:
            raise ConfigError(f"{self._path}: cannot be written ({error.strerror})") from error
        self._folder.chmod(0o755)
        self._files = _Files()
        self._mounting: dict[str, dict[str, object]] = {}
        self._base_frame = ""
        self._closed = False

    def __enter__(self) -> CsvFolderWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def write(self, event: Event, topic: str | None = None) -> None:
        """Append one event. `topic` keeps two streams of one kind apart."""
        if not 0 <= event.stamp_ns < END_NS:
            raise LogError(
                f"stamp {event.stamp_ns} ns of a {type(event).__name__} cannot be written: 0 to 2^31 s can"
            )
        if isinstance(event, StereoPair):
            for side, pixels in (("left", event.left), ("right", event.right)):
                camera = f"{(topic or 'stereo').strip('/')}/{side}"
                self.write(Image(event.stamp_ns, event.frame_id, pixels, camera), f"/{camera}/image_rect")
        elif isinstance(event, Transform) and event.is_static:
            self._mount(event)
        else:
            kind = "truth" if topic == TRUTH_TOPIC else KIND_OF_EVENT[type(event)]
            self._append(kind, event, topic)

    def write_truth(self, pose: Odometry) -> None:
        """Append the true pose, to truth.csv."""
        self.write(pose, TRUTH_TOPIC)

    def close(self) -> None:
        """Complete the folder and give it its name."""
        if self._closed:
            return
        try:
            for file in self._files.by_key.values():
                file.stream.close()
            layout: dict[str, object] = {"version": 1}
            if self._base_frame:
                layout["base_frame"] = self._base_frame
            layout["streams"] = [file.layout for file in self._files.by_key.values()]
            if self._mounting:
                layout["mounting"] = self._mounting
            text = yaml.safe_dump(
                layout, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
            )
            (self._folder / LAYOUT_FILE).write_text(text, encoding="utf-8")
            self._put_in_place()
            self._closed = True
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Leave nothing behind."""
        for file in self._files.by_key.values():
            file.stream.close()
        self._closed = True
        shutil.rmtree(self._folder, ignore_errors=True)

    def _put_in_place(self) -> None:
        if not self._force and self._path.exists():
            raise ConfigError(f"{self._path}: exists already; choose another name or give --force")
        if self._path.is_dir() and not self._path.is_symlink():
            old = self._folder.with_name(self._folder.name + ".old")
            self._path.rename(old)
            self._folder.rename(self._path)
            shutil.rmtree(old)
        else:
            self._path.unlink(missing_ok=True)
            self._folder.rename(self._path)

    def _mount(self, transform: Transform) -> None:
        x, y, z = transform.translation_m
        entry: dict[str, object] = {"x": x, "y": y, "z": z, "quat_wxyz": list(transform.quat_wxyz)}
        entry["parent"] = transform.frame_id
        self._mounting[transform.child_frame_id] = entry

    def _append(self, kind: str, event: Any, topic: str | None) -> None:
        frames = () if kind in _MANY_FRAMES or kind in ("range", "tf") else (event.frame_id,)
        if kind in ("odom", "truth"):
            frames += (event.child_frame_id,)
        elif kind == "tf":
            frames += (event.frame_id, event.child_frame_id)
        key = (kind, topic or "", *frames)
        file = self._files.by_key.get(key)
        if file is None:
            file = self._open(kind, event, topic)
            self._files.by_key[key] = file
        file.rows += 1
        for row in ROWS[kind](self, event):
            file.writer.writerow([format_stamp(event.stamp_ns), *row])

    def _open(self, kind: str, event: Any, topic: str | None) -> _File:
        name, number = f"{kind}.csv", 1
        while name in self._files.names:
            number += 1
            name = f"{kind}_{number}.csv"
        self._files.names.add(name)
        layout = {"kind": kind, "file": name}
        if topic:
            layout["topic"] = topic
        if kind not in _MANY_FRAMES and kind not in ("range", "tf"):
            layout["frame"] = event.frame_id
        if kind in ("odom", "truth"):
            layout["child_frame"] = event.child_frame_id
            if kind == "odom" and not self._base_frame:
                self._base_frame = event.child_frame_id
        stream = (self._folder / name).open("w", encoding="utf-8", newline="")
        writer = csv.writer(stream, lineterminator="\n")
        header = ["stamp", *COLUMNS[kind].required, *(c for c in COLUMNS[kind].optional if c != "frame")]
        if kind in _MANY_FRAMES:
            header.append("frame")
        if kind == "scan":
            header += [f"r{i}" for i in range(len(event.ranges_m))]
        writer.writerow(header)
        return _File(stream, writer, layout)

    def picture(
        self, kind: str, event: Any, write: Callable[[Path, Any], None], pixels: Any, suffix: str
    ) -> str:
        """Write a picture file; its name inside the folder."""
        camera = "".join(c if c.isalnum() or c in "-_" else "_" for c in event.camera) or "camera"
        folder = self._folder / f"{kind}_{camera}"
        folder.mkdir(exist_ok=True)
        name, number = f"{event.stamp_ns:019d}{suffix}", 1
        while (folder / name).exists():
            number += 1
            name = f"{event.stamp_ns:019d}_{number}{suffix}"
        write(folder / name, pixels)
        return f"{folder.name}/{name}"
