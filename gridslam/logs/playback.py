"""From a source's raw messages to the events of `Log.events`: checked, in order, counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
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
from gridslam.core.stamps import END_NS
from gridslam.logs.checks.plausibility import ScanPlausibility
from gridslam.logs.codecs import odometry
from gridslam.logs.kind_lookup import unusable_reason
from gridslam.logs.kinds import KINDS
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order import ordering
from gridslam.logs.placement.cloud_floor import first_items, lidars_on_the_floor
from gridslam.logs.placement.virtual_scan import VirtualLidar
from gridslam.logs.skips import Skip, SkipReason
from gridslam.logs.stereo import Pairing
from gridslam.logs.streams import Source

# At the beginning of a stream, by which it is judged before the first scan is given to a method
PEEKED_SCANS = 60

FileStates: TypeAlias = list[tuple[int, int]]  # size and time of change of each file


def events_of(
    path: Path,
    source: Source,
    kind_of: dict[int, str],
    by_stamp: bool,
    limit_bytes: int,
    message_counts: MessageCounts,
    states: FileStates,
    lidars: Mapping[str, VirtualLidar] = MappingProxyType({}),
    with_repairs: bool = True,
    restamped: frozenset[int] = frozenset(),
    span_ns: tuple[int, int] = (0, END_NS),
    sweep_s: float | None = None,
) -> Iterator[tuple[str, str, Event]]:
    """(kind, topic, event) of the streams in `kind_of`, merged by stamp.

    `source` reads the log, and `path` names it in messages. Messages that cannot be used are counted in `message_counts`.
    `kind_of` gives, by index of the stream, the kind that it serves as, in order of precedence at equal stamps. `by_stamp`
    sorts within a stream as well. At most `limit_bytes` of events wait for earlier ones. `states` are those of the files when
    the log was opened. `lidars` make scans of point clouds, by the clouds' frame; `with_repairs` removes contradictions within
    scans. The events of streams in `restamped` get the stamps that the streams have. Events outside the stamps `span_ns` are
    left out. `sweep_s` is the time of a scan that says none.

    Raises LogError: the files have changed since the log was opened.
    """
    streams = source.streams
    ranks, schedule = ordering.merge_plan({i: streams[i].stamps_ns for i in kind_of}, by_stamp)
    ordered = ordering.in_planned_order(
        _checked(
            source,
            kind_of,
            _restamped(source, kind_of, schedule, restamped),
            message_counts,
            with_repairs=with_repairs,
            sweep_s=sweep_s,
        ),
        ranks,
        size_of=_size_of,
        limit_bytes=limit_bytes,
        on_late=lambda i: _note_late(message_counts, kind_of[i]),
    )
    count, remaining = message_counts.counters, len(schedule)
    keys = {i: f"read.{kind}" for i, kind in kind_of.items()}
    to_convert = {i for i, kind in kind_of.items() if kind != streams[i].kind or kind == "truth"}
    pairing = Pairing()
    if with_repairs:
        lidars = lidars_on_the_floor(source, kind_of, lidars, message_counts)
    for index, event in ordered:
        remaining -= 1
        topic = streams[index].topic
        if isinstance(event, Skip):
            message_counts.skip(kind_of[index], event.reason.value, event.where)
            message_counts.unusable[index] += 1
            continue
        if not span_ns[0] <= event.stamp_ns <= span_ns[1]:
            continue
        if index in to_convert:
            if isinstance(event, PointCloud):
                converted: Event | None = lidars[event.frame_id].scan(event)
            else:
                converted = _converted(event, topic, pairing, message_counts)
            if converted is None:
                continue
            event = converted
        count[keys[index]] += 1
        yield kind_of[index], topic, event
    for image in pairing.unpaired():
        _skip_unpaired(message_counts, image, image.camera)
    if remaining > 0:
        if file_states(source.files) != states:
            raise LogError(f"{path}: changed while it was read ({remaining} messages are gone); run again")
        message_counts.lose("messages", f"the end of {path.name}", remaining)


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


def _restamped(
    source: Source, kind_of: Mapping[int, str], schedule: Sequence[int], restamped: frozenset[int]
) -> Iterator[tuple[int, Event | Skip]]:
    """The items of the source, with the stamps of their streams where those have been replaced."""
    items = source.read(frozenset(kind_of), schedule)
    if not restamped:
        yield from items
        return
    stamps = {i: iter(source.streams[i].stamps_ns) for i in restamped}
    for index, event in items:
        stamp = next(stamps[index], None) if index in stamps else None
        if stamp is not None and not isinstance(event, Skip):
            event = replace(event, stamp_ns=stamp)
        yield index, event


def _checked(
    source: Source,
    kind_of: dict[int, str],
    items: Iterator[tuple[int, Event | Skip]],
    message_counts: MessageCounts,
    *,
    with_repairs: bool,
    sweep_s: float | None,
) -> Iterator[tuple[int, Event | Skip]]:
    """The items, each event that no method can use replaced by the reason."""
    outliers = {i: ordering.outlier_places(source.streams[i].stamps_ns) for i in kind_of}
    numbers = dict.fromkeys(kind_of, 0)
    repairs = _repairs(source, kind_of, message_counts, sweep_s) if with_repairs else {}
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
            where = where or f"{source.streams[index].label} message {number}"
            yield index, Skip(reason, f"{where}: {detail!r}" if detail else where)
        else:
            yield index, event


def _repairs(
    source: Source, kind_of: Mapping[int, str], message_counts: MessageCounts, sweep_s: float | None
) -> dict[int, Callable[[Any], Event]]:
    """By stream, what makes events of which contradictions are removed."""
    found: dict[int, Callable[[Any], Event]] = {}
    for index, kind in kind_of.items():
        stream = source.streams[index]
        if kind == "scan" and stream.kind == "scan":
            first = _first_scans(source, index)
            check = ScanPlausibility(stream.stamps_ns, stream.label, message_counts, sweep_s, first)
            found[index] = check.repaired
        elif (repair := KINDS[stream.kind].repair) is not None:
            found[index] = repair(stream.label, message_counts).repaired
    return found


def _first_scans(source: Source, index: int) -> list[LaserScan]:
    """The first scans of a stream."""
    return [event for event in first_items(source, index, PEEKED_SCANS) if isinstance(event, LaserScan)]


def _converted(event: Event, topic: str, pairing: Pairing, message_counts: MessageCounts) -> Event | None:
    """The event as the kind that its stream serves as; None if it only waits for its partner.

    A transform and a true pose become odometry. An image becomes the stereo pair that it completes.
    """
    if isinstance(event, Transform):
        return odometry.from_transform(event)
    if isinstance(event, AbsolutePose):
        return true_pose_of(event)
    if not isinstance(event, Image):
        return event
    pair, unpaired = pairing.add(event, topic)
    if unpaired is not None:
        _skip_unpaired(message_counts, unpaired, topic)
    return pair


def _skip_unpaired(message_counts: MessageCounts, image: Image, name: str) -> None:
    message_counts.skip("stereo", SkipReason.NO_PARTNER.value, f"{name} stamp {image.stamp_ns}")


def _size_of(event: Event | Skip) -> int:
    """Rough memory of a waiting event in bytes."""
    size = 400
    for name in ("ranges_m", "points_m", "pixels", "disparity_px", "depth_m"):
        array = getattr(event, name, None)
        if array is not None:
            size += int(array.nbytes)
    return size
