"""A folder of a public dataset as a source of streams: lists of stamps, and events that are read when they are needed."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gridslam.core.messages import Event, Transform
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.skips import Skip, SkipReason, UnusableMessageError
from gridslam.logs.streams import RecordedStream

BASE_FRAME = "base_link"


@dataclass(frozen=True, slots=True)
class DatasetStream:
    """A stream of `len(stamps_ns)` events; `event` reads the k-th of them."""

    kind: str
    topic: str
    frame: str
    stamps_ns: Sequence[int]
    event: Callable[[int], Event]


class DatasetSource:
    """The streams of a dataset. `files` are those that list the measurements, `static_edges` the extrinsics."""

    compression = "none"
    order: Literal["recorded", "stamp"] = "recorded"
    base_frame: str | None = BASE_FRAME

    def __init__(
        self,
        name: str,
        streams: Sequence[DatasetStream],
        static_edges: Sequence[Transform],
        files: Sequence[Path],
        notes: Sequence[str] = (),
    ) -> None:
        self.format = name
        self.static_edges = list(static_edges)
        self.files = list(files)
        self.message_counts = MessageCounts()
        for note in notes:
            self.message_counts.note(note)
        self._streams = list(streams)
        self.streams = [
            RecordedStream(s.kind, s.topic, name, stamps_ns=array("q", s.stamps_ns), frames={s.frame: None})
            for s in streams
        ]

    def close(self) -> None:
        """Do nothing: no file stays open between passes."""

    def read(self, wanted: frozenset[int], schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """Events in the order of `schedule`."""
        numbers = dict.fromkeys(wanted, 0)
        for index in schedule:
            stream, number = self._streams[index], numbers[index]
            numbers[index] += 1
            try:
                yield index, stream.event(number)
            except UnusableMessageError as error:
                yield index, Skip(error.reason, detail=error.detail)
            except (OSError, ValueError):
                yield index, Skip(SkipReason.UNREADABLE_IMAGE)
