"""From a source's raw messages to the events of `Log.events`: checked, in order, counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from gridslam.core.errors import LogError
from gridslam.core.messages import (
    AbsolutePose,
    Event,
    Image,
    LaserScan,
    Odometry,
    PointCloud,
    Transform,
)
from gridslam.logs.checks.plausibility import ScanPlausibility
from gridslam.logs.codecs import odometry
from gridslam.logs.kind_lookup import unusable_reason
from gridslam.logs.kinds import KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order import ordering
from gridslam.logs.placement.cloud_floor import lidars_on_the_floor
from gridslam.logs.placement.virtual_scan import VirtualLidar
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.stereo import Pairing
from gridslam.logs.streams import Source, first_items

# At the beginning of a stream, by which it is judged before the first scan is given to a method
PEEKED_SCANS = 60

FileStates: TypeAlias = list[tuple[int, int]]  # size and time of change of each file


@dataclass(frozen=True, slots=True)
class Playback:
    """Events of some streams of a log.

    `source` reads the log, and `path` names it in messages. `kind_of` gives, by index of the stream, the kind that it serves as,
    in order of precedence at equal stamps. `states` are those of the files when the log was opened. Messages that cannot be used
    are counted in `message_counts`. `by_stamp` sorts within a stream as well; at most `limit_bytes` of events wait for earlier
    ones. `lidars` make scans of point clouds, by the clouds' frame. `with_repairs` removes contradictions within scans. The
    events of streams in `restamped` get the stamps that the streams have. Events outside the stamps `span_ns` are left out.
    `sweep_s` is the duration of a scan that states none.
    """

    path: Path
    source: Source
    kind_of: Mapping[int, str]
    states: FileStates
    message_counts: MessageCounts
    by_stamp: bool
    limit_bytes: int
    lidars: Mapping[str, VirtualLidar]
    with_repairs: bool
    restamped: frozenset[int]
    span_ns: tuple[int, int]
    sweep_s: float | None

    def events(self) -> Iterator[tuple[str, str, Event]]:
        """(kind, topic, event), merged by stamp. Raises LogError: the files have changed since the log was opened."""
        streams, kind_of, message_counts = self.source.streams, self.kind_of, self.message_counts
        ranks, schedule = ordering.merge_plan({i: streams[i].stamps_ns for i in kind_of}, self.by_stamp)
        ordered = ordering.in_planned_order(
            self._checked(self._restamped(schedule)),
            ranks,
            size_of=_size_of,
            limit_bytes=self.limit_bytes,
            on_late=lambda i: _note_late(message_counts, kind_of[i]),
        )
        count, remaining = message_counts.counters, len(schedule)
        keys = {i: f"read.{kind}" for i, kind in kind_of.items()}
        convert = self._conversion()
        for index, event in ordered:
            remaining -= 1
            topic = streams[index].topic
            if isinstance(event, Skip):
                message_counts.skip(kind_of[index], event.reason.value, event.where)
                message_counts.unusable[index] += 1
                continue
            if not self.span_ns[0] <= event.stamp_ns <= self.span_ns[1]:
                continue
            served = convert.event(event, topic) if index in convert.streams else event
            if served is not None:
                count[keys[index]] += 1
                yield kind_of[index], topic, served
        convert.end()
        if remaining > 0:
            if file_states(self.source.files) != self.states:
                raise LogError(
                    f"{self.path}: changed while it was read ({remaining} messages are gone); run again"
                )
            message_counts.lose("messages", f"the end of {self.path.name}", remaining)

    def _conversion(self) -> _Conversion:
        """The conversion to the kinds that the streams serve as."""
        streams, lidars = self.source.streams, self.lidars
        to_convert = frozenset(
            i for i, kind in self.kind_of.items() if kind != streams[i].kind or kind == "truth"
        )
        if self.with_repairs:
            lidars = lidars_on_the_floor(self.source, self.kind_of, lidars, self.message_counts)
        return _Conversion(to_convert, lidars, self.message_counts)

    def _restamped(self, schedule: Sequence[int]) -> Iterator[tuple[int, Event | Skip]]:
        """The items of the source, with the stamps of their streams where those have been replaced."""
        items = self.source.read(frozenset(self.kind_of), schedule)
        if not self.restamped:
            yield from items
            return
        stamps = {i: iter(self.source.streams[i].stamps_ns) for i in self.restamped}
        for index, event in items:
            stamp = next(stamps[index], None) if index in stamps else None
            if stamp is not None and not isinstance(event, Skip):
                event = replace(event, stamp_ns=stamp)
            yield index, event

    def _checked(self, items: Iterator[tuple[int, Event | Skip]]) -> Iterator[tuple[int, Event | Skip]]:
        """The items, each event that no method can use replaced by the reason."""
        streams = self.source.streams
        outliers = {i: ordering.outlier_places(streams[i].stamps_ns) for i in self.kind_of}
        numbers = dict.fromkeys(self.kind_of, 0)
        repairs = self._repairs() if self.with_repairs else {}
        for index, event in items:
            if index in repairs and not isinstance(event, Skip):
                event = repairs[index](event)
            number = numbers[index] = numbers[index] + 1
            reason: SkipReason | None
            detail = ""
            if isinstance(event, Skip):
                reason, where, detail = event.reason, event.where, event.detail
            else:
                reason, where = unusable_reason(event), ""
                if number - 1 in outliers[index]:
                    reason = SkipReason.OUTLIER_STAMP
            if reason:
                where = where or f"{streams[index].label} message {number}"
                yield index, Skip(reason, f"{where}: {detail!r}" if detail else where)
            else:
                yield index, event

    def _repairs(self) -> dict[int, Callable[[Any], Event]]:
        """By stream, what makes events of which contradictions are removed."""
        counts = self.message_counts
        found: dict[int, Callable[[Any], Event]] = {}
        for index, kind in self.kind_of.items():
            stream = self.source.streams[index]
            if kind == "scan" and stream.kind == "scan":
                first = _first_scans(self.source, index)
                check = ScanPlausibility(stream.stamps_ns, stream.label, counts, self.sweep_s, first)
                found[index] = check.repaired
            elif (repair := KINDS[stream.kind].repair) is not None:
                found[index] = repair(stream.label, counts).repaired
        return found


class _Conversion:
    """Makes events of the kinds that their `streams` serve as, which are others than were recorded."""

    def __init__(
        self, streams: frozenset[int], lidars: Mapping[str, VirtualLidar], message_counts: MessageCounts
    ) -> None:
        self.streams = streams
        self._lidars = lidars
        self._message_counts = message_counts
        self._pairing = Pairing()

    def event(self, event: Event, topic: str) -> Event | None:
        """The event as the kind that its stream serves as; None if it only waits for its partner.

        A cloud becomes a scan; a transform and a true pose become odometry; an image becomes the stereo pair that it completes.
        """
        if isinstance(event, PointCloud):
            return self._lidars[event.frame_id].scan(event)
        if isinstance(event, Transform):
            return odometry.from_transform(event)
        if isinstance(event, AbsolutePose):
            return true_pose_of(event)
        if not isinstance(event, Image):
            return event
        pair, unpaired = self._pairing.add(event, topic)
        if unpaired is not None:
            self._skip_unpaired(unpaired, topic)
        return pair

    def end(self) -> None:
        """Count the images that are still waiting for their partners."""
        for image in self._pairing.unpaired():
            self._skip_unpaired(image, image.camera)

    def _skip_unpaired(self, image: Image, name: str) -> None:
        where = f"{name} stamp {image.stamp_ns}"
        self._message_counts.skip("stereo", SkipReason.NO_PARTNER.value, where)


def file_states(files: Iterable[Path]) -> FileStates:
    """Size and time of change of each file, 0 for a file that is gone."""
    return [_state_of(file) for file in files]


def _state_of(file: Path) -> tuple[int, int]:
    try:
        state = file.stat()
    except OSError:
        return 0, 0
    return state.st_size, state.st_mtime_ns


def _note_late(message_counts: MessageCounts, kind: str) -> None:
    message_counts.count(f"late.{kind}")
    message_counts.note(
        f"some {kind} messages come out of order: raise log.limits.reorder_mb to hold more of them back"
    )


def true_pose_of(event: Event | Skip) -> Odometry | None:
    """The true pose in a message of the stream that holds the truth; None for other messages."""
    if isinstance(event, AbsolutePose):
        x, y, yaw = (float(v) for v in event.pose)
        return Odometry(event.stamp_ns, event.frame_id, x, y, yaw)
    return event if isinstance(event, Odometry) else None


def _first_scans(source: Source, index: int) -> list[LaserScan]:
    """The first scans of a stream."""
    return [event for event in first_items(source, index, PEEKED_SCANS) if isinstance(event, LaserScan)]


def _size_of(event: Event | Skip) -> int:
    """Rough memory of a waiting event in bytes."""
    size = 400
    for name in ("ranges_m", "points_m", "pixels", "disparity_px", "depth_m"):
        array = getattr(event, name, None)
        if array is not None:
            size += int(array.nbytes)
    return size
