"""From a source's raw order to what `Log.events` delivers: checked, in order, counted."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.core.messages import AbsolutePose, Event, Image, Odometry, Transform, canonical_yaw
from gridslam.logs import checks, ordering, rotations
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.stereo import Pairing
from gridslam.logs.streams import Skip, Source


def deliver(
    path: Path,
    source: Source,
    kind_of: dict[int, str],
    by_stamp: bool,
    limit_bytes: int,
    message_counts: MessageCounts,
) -> Iterator[tuple[str, Event]]:
    """(topic, event) of the chosen streams, merged by stamp; what cannot be used is entered in the message_counts.

    Raises LogError when the log is no longer what it was when it was opened.
    """
    streams = source.streams
    ranks, schedule = ordering.plan({i: streams[i].stamps_ns for i in kind_of}, by_stamp)
    delivered = ordering.deliver(
        _checked(source, kind_of, source.read(frozenset(kind_of), schedule)),
        ranks,
        _size_of,
        limit_bytes,
        lambda i: _note_late(message_counts, kind_of[i]),
    )
    count, left = message_counts.counters, len(schedule)
    keys = {i: f"read.{kind}" for i, kind in kind_of.items()}
    special = {i for i, kind in kind_of.items() if kind != streams[i].kind or kind == "truth"}
    pairing = Pairing()
    for index, event in delivered:
        left -= 1
        topic = streams[index].topic
        if isinstance(event, Skip):
            message_counts.skip(kind_of[index], event.reason, event.where)
            continue
        if index in special:
            joined = _special(event, topic, pairing, message_counts)
            if joined is None:
                continue
            event = joined
        count[keys[index]] += 1
        yield topic, event
    for image in pairing.rest():
        message_counts.skip("stereo", "no_partner", f"{image.camera} stamp {image.stamp_ns}")
    if left > 0:
        raise LogError(f"{path}: changed while it was read ({left} messages are gone); run again")


def _note_late(message_counts: MessageCounts, kind: str) -> None:
    message_counts.count(f"late.{kind}")
    message_counts.note(
        f"some {kind} messages come out of order: raise log.limits.reorder_mb to hold more of them back"
    )


def odometry_of(transform: Transform) -> Odometry:
    """The transform odom->base as odometry."""
    x, y, _ = transform.translation_m
    yaw = canonical_yaw(rotations.yaw_of(transform.quat_wxyz))
    return Odometry(
        transform.stamp_ns, transform.frame_id, x, y, yaw, child_frame_id=transform.child_frame_id
    )


def as_truth(event: Event | Skip) -> Odometry | None:
    """The true pose that a message tells; None for anything else."""
    if isinstance(event, AbsolutePose):
        x, y, yaw = (float(v) for v in event.pose)
        return Odometry(event.stamp_ns, event.frame_id, x, y, yaw)
    return event if isinstance(event, Odometry) else None


def _checked(
    source: Source, kind_of: dict[int, str], items: Iterator[tuple[int, Event | Skip]]
) -> Iterator[tuple[int, Event | Skip]]:
    """The items, each that no method can use replaced by the reason why."""
    strays = {i: ordering.strays(source.streams[i].stamps_ns) for i in kind_of}
    numbers = dict.fromkeys(kind_of, 0)
    fault_of = checks.fault_of
    for index, event in items:
        number = numbers[index] = numbers[index] + 1
        if isinstance(event, Skip):
            fault, where = event.reason, event.where
        else:
            fault, where = fault_of(event) or "", ""
            if number - 1 in strays[index]:
                fault = "stray_stamp"
        if fault:
            where = where or f"{source.streams[index].label} message {number}"
            yield index, Skip(fault, where)
        else:
            yield index, event


def _special(event: Event, topic: str, pairing: Pairing, message_counts: MessageCounts) -> Event | None:
    """Odometry for a transform and for a true pose; for an image the pair that it completes, if it does."""
    if isinstance(event, Transform):
        return odometry_of(event)
    if isinstance(event, AbsolutePose):
        return as_truth(event)
    if not isinstance(event, Image):
        return event
    pair, alone = pairing.add(event, topic)
    if alone is not None:
        message_counts.skip("stereo", "no_partner", f"{topic} stamp {alone.stamp_ns}")
    return pair


def _size_of(event: Event | Skip) -> int:
    """Memory of a waiting event, roughly, in bytes."""
    size = 400
    for name in ("ranges_m", "pixels", "disparity_px", "depth_m"):
        array = getattr(event, name, None)
        if array is not None:
            size += int(array.nbytes)
    return size
