"""Definition of one kind of stream: its schemas, codecs and checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gridslam.core.messages import Event
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded
from gridslam.logs.skips import SkipReason

FromRos = Callable[[Any, str], Event]  # (decoded message, topic)
FromFoxglove = Callable[[int, str, Any, str], Event]  # (stamp_ns, frame, decoded message, topic)


@dataclass(frozen=True, slots=True)
class CsvTableKind:
    """CSV table of a message kind; the first column is the stamp.

    `rows_name_frames`: each row names its frame; else a table names one for all rows, as long as they agree.
    """

    from_rows: Callable[[list[Row]], Event]
    to_rows: Callable[[Any, PictureWriter], list[list[str]]]
    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    default_frame: str = ""  # frame_id where neither log.yaml nor the row names one
    frame_column: str = "frame"
    rows_name_frames: bool = False
    has_ranges: bool = False  # columns r0, r1, ... come last
    has_pictures: bool = False  # the column `file` names a picture


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One kind of stream.

    `message` is the class of its events. `ros` and `foxglove` give, by the name of a schema, the conversion of a
    decoded message; None where decoding depends on more than the message (`ros/decoder.py`). `to_ros` encodes an
    event for a topic, None for the usual one. `unusable_reason` says why no method can use an event.
    """

    name: str
    message: type | None = None
    ros: Mapping[str, FromRos | None] = field(default_factory=dict)
    foxglove: Mapping[str, FromFoxglove | None] = field(default_factory=dict)
    to_ros: Callable[[Any, str | None], list[Encoded]] | None = None
    csv: CsvTableKind | None = None
    unusable_reason: Callable[[Any], SkipReason | None] | None = None
    is_single: bool = (
        False  # a method takes one stream of the kind; of others (cameras, rangers) it takes all
    )
    is_event: bool = True  # methods can take it; the others serve as truth, or turn rangers
    is_sensor: bool = False  # its frames are sensors, whose extrinsics matter
    is_named_by_camera: bool = False  # its usual topic holds the camera's name
