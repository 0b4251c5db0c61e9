"""Streams of a log, and the interface that every reader of a file format offers to `Log`."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Literal, Protocol

from gridslam.core.messages import Event, Transform
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.rotations import Rigid
from gridslam.logs.skips import Skip


@dataclass(slots=True)
class RecordedStream:
    """One stream of a log. `stamps_ns` has one entry per event, in recorded order."""

    kind: str
    topic: str
    type: str
    detail: str = ""  # of a tf stream: parent->child
    stamps_ns: array[int] = field(default_factory=lambda: array("q"))
    frames: dict[str, None] = field(default_factory=dict)  # an ordered set
    child_frame: str = ""
    constant: Rigid | None = None  # of a tf stream: its value, if it never changes
    arrivals_ns: array[int] = field(default_factory=lambda: array("q"))  # when recorded; empty: not known

    @property
    def label(self) -> str:
        """The name in messages to the user."""
        return f"{self.topic} ({self.detail})" if self.detail else self.topic


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """One stream as shown to the user.

    `detail` of a tf stream is parent->child. `out_of_order` is the number of stamps that are smaller than the previous one.
    `used`: `Log.events` includes the stream.
    """

    kind: str
    topic: str
    detail: str
    type: str
    count: int
    first_stamp_ns: int | None
    last_stamp_ns: int | None
    frame: str
    out_of_order: int
    used: bool

    @property
    def label(self) -> str:
        """The name in messages to the user."""
        return f"{self.topic} ({self.detail})" if self.detail else self.topic


class Source(Protocol):
    """A log in one file format. It is indexed when opened (stamps, frames, damage) and read again by `read`."""

    format: str
    compression: str
    order: Literal["recorded", "stamp"]
    base_frame: str | None
    streams: list[RecordedStream]
    files: list[Path]
    message_counts: MessageCounts

    @property
    def static_edges(self) -> list[Transform]:
        """The transforms that never change."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """(stream index, event) for every stamp of the wanted streams, per stream in recorded order.

        `schedule` names the streams in the order in which their events are needed; a reader that can choose
        (one file per stream) follows it.
        """

    def close(self) -> None:
        """Close open files."""


def first_items(source: Source, index: int, count: int) -> list[Event | Skip]:
    """The first items of a stream."""
    schedule = [index] * len(source.streams[index].stamps_ns)
    return [event for _, event in islice(source.read(frozenset({index}), schedule), count)]
