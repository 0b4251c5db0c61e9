"""Definition of one kind of stream: its schemas, codecs and checks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, Protocol

from gridslam.core.messages import Event
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import SkipReason

FromRos = Callable[[Any, str], Event]  # (decoded message, topic)
FromFoxglove = Callable[[int, str, Any, str], Event]  # (stamp_ns, frame, decoded message, topic)

# Units in which a file may state a column; a length or an angle stands for one per second where rates are.
LENGTHS = frozenset({"m", "cm", "mm"})
ANGLES = frozenset({"rad", "deg", "rad_clockwise", "deg_clockwise"})
TIMES = frozenset({"s", "ms", "us", "ns"})
SPEEDS = LENGTHS | {"m/s"}
RATES = ANGLES | {"rad/s", "deg/s"}


class EventRepair(Protocol):
    """Removes contradictions from the events of one stream, in order."""

    def repaired(self, event: Any, /) -> Event:
        """The event without contradictions; the same object where it has none."""


class RowGroups(NamedTuple):
    """Rows in succession with one stamp and one text in column `by` are one event.

    Each has one `item` of the event; a row without an item is an event of its own.
    """

    by: str
    item: str


@dataclass(frozen=True, slots=True)
class CsvTableKind:
    """CSV table of a message kind; the first column is the stamp.

    `rows_name_frames`: each row names its frame; else a table names one for all rows, as long as they agree. `texts` are columns
    of text, `lists` those of several numbers in a field; all others hold a number, in our unit or one of `units`.
    """

    from_rows: Callable[[list[Row]], Event]
    to_rows: Callable[[Any, PictureWriter], list[list[str]]]
    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    default_frame: str = ""  # frame_id where neither log.yaml nor the row names one
    texts: tuple[str, ...] = ()
    lists: tuple[str, ...] = ()
    units: Mapping[str, frozenset[str]] = field(default_factory=dict)
    frame_column: str = "frame"  # empty: rows name no single frame
    naming_column: str = ""  # names the frame where the frame's column does not
    rows_name_frames: bool = False
    groups: RowGroups | None = None
    apart_by: tuple[str, ...] = ()  # attributes of events that keep tables of one topic apart
    has_ranges: bool = False  # columns r0, r1, ... come last
    has_pictures: bool = False  # the column `file` names a picture


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One kind of stream.

    `message` is the class of its events. `ros` and `foxglove` give, by the name of a schema, the conversion of a
    decoded message; None if decoding depends on more than the message (`ros/decoder.py`). `shared_ros` and
    `shared_foxglove` are conversions of schemas of another kind, whose streams are of this kind if it `claims` their first
    message (decoded message, topic). `definitions` are those of schemas that ROS does not have. `to_ros` encodes an
    event for a topic, None for the usual one. `unusable_reason` says why no method can use an event; `repair` is made for each
    stream that a method reads, from the stream's name in messages to the user.

    `several` says which of several streams of the kind a method gets: all, one that the config names, the densest, or all if
    each has a frame of its own. `csv_parts` divides an event without a table into events that have one, with their topics.
    """

    name: str
    message: type | None = None
    ros: Mapping[str, FromRos | None] = field(default_factory=dict)
    foxglove: Mapping[str, FromFoxglove | None] = field(default_factory=dict)
    shared_ros: Mapping[str, FromRos] = field(default_factory=dict)
    shared_foxglove: Mapping[str, FromFoxglove] = field(default_factory=dict)
    claims: Callable[[Any, str], bool] | None = None
    definitions: Mapping[str, str] = field(default_factory=dict)
    to_ros: Callable[[Any, str | None], list[Encoded]] | None = None
    csv: CsvTableKind | None = None
    csv_parts: Callable[[Any, str | None], list[tuple[Event, str]]] | None = None
    unusable_reason: Callable[[Any], SkipReason | None] | None = None
    repair: Callable[[str, MessageCounts], EventRepair] | None = None
    several: Literal["all", "one", "densest", "of_own_frames"] = "all"
    may_be_truth: bool = False  # its streams hold poses that log.truth may name
    is_event: bool = True  # methods can take it; the others serve as truth, or turn rangers
    is_sensor: bool = False  # its frames are sensors, whose extrinsics matter
    is_named_by_camera: bool = False  # its usual topic holds the camera's name
