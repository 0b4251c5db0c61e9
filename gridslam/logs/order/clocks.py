"""Replaces stamps that were never set, or that come from another clock, by times of arrival.

Stamps that are all zero were never set. Streams whose clocks differ by seconds cannot be used together, but if the recorder
stored the time of arrival of each message, these times show the difference.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import LogError
from gridslam.core.stamps import END_NS, NS_PER_S
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order.even_stamps import evened
from gridslam.logs.order.repeats import copies_among
from gridslam.logs.streams import RecordedStream

# Smallest offset that shows two clocks: drivers and networks delay messages by less
MAX_OFFSET_NS = 5 * NS_PER_S
# Largest drift of the recorder's clock against the stamps: beyond it the stamps are not times, but counts, or copies
MAX_DRIFT = 0.05
# A lidar is silent where it has no scans for so long, in seconds and relative to the drive, at its start or end
MIN_SILENT_S, MIN_SILENT_FRACTION = 5.0, 0.1
OUTER_STAMPS = 2  # number of stamps at each end of a stream that may be outliers
MIN_OVERLAP, FULL_OVERLAP = 0.1, 0.5  # fraction of the scans that odometry covers: below, an error and a note
TIMED_KINDS = ("scan", "cloud", "odom", "imu")  # kinds whose stamps matter for the robot's pose
MIN_STAMPS = 20  # fewer show no regularity
MAX_EQUAL = 0.6  # fraction of stamps that are the one before: beyond it they are too coarse for times
# The smallest other stamp beside which a zero was not set: simulated clocks begin at 0
MIN_SET_NS = 1000 * NS_PER_S
MAX_UNSET = 0.1  # fraction of zeros that are skipped where nothing replaces them
# Stamps jitter, or come in bursts, where their steps are as uneven as this, relative to their mean, and more uneven than the
# steps of the arrivals by the ratio.
MIN_UNEVENNESS, MIN_UNEVENNESS_RATIO = 0.12, 4.0
MAX_BEHIND_NS = NS_PER_S // 2  # of stamps that jitter, before the latest one
MAX_SPAN_ERROR = 0.2  # between the spans of both, relative: arrivals that are counts say nothing
# The only replaced stamps that are early and late by turns: the delay of the arrivals is then the median one
UNEVEN = "stamps jitter, or come in bursts"
EDGE_NS = NS_PER_S  # scans so long before and after the odometry count as covered

Stamps = NDArray[np.int64]


def restamp(
    streams: Sequence[RecordedStream], kind_of: Mapping[int, str], message_counts: MessageCounts
) -> frozenset[int]:
    """Replace stamps that were never set, and stamps of other clocks than the recorder's; returns the streams with new stamps.

    The stamps of the streams in `kind_of` are changed in place. Each replacement is noted. Raises LogError: stamps were never
    set, and nothing replaces them.
    """
    used = [i for i in kind_of if len(streams[i].stamps_ns) > 1]
    changed = {i for i in used if _replace_unset(streams[i], message_counts)}
    changed |= {i for i in used if i not in changed and _even_out(streams[i], message_counts)}
    offsets = {i: offset for i in used if (offset := _clock_offset_ns(streams[i])) is not None}
    if not offsets or max(offsets.values()) - min(offsets.values()) <= MAX_OFFSET_NS:
        return frozenset(changed)
    for index, offset in offsets.items():
        if abs(offset) > MAX_OFFSET_NS:
            stream = streams[index]
            stream.stamps_ns = _valid(_stamps(stream) + offset)
            message_counts.find(
                f"{stream.label}: its stamps are {abs(offset) / NS_PER_S:.1f} s {'behind' if offset > 0 else 'ahead of'} "
                "the recorder's clock, those of other streams are not: shifted by that"
            )
            changed.add(index)
    return frozenset(changed)


def _replace_unset(stream: RecordedStream, message_counts: MessageCounts) -> bool:
    """Replace stamps of one stream that were never set, or only now and then, by times of arrival; whether any were.

    Raises LogError: they are those of scans or odometry, and nothing replaces them.
    """
    stamps = _stamps(stream)
    has_arrivals = _is_clock(stream.arrivals_ns, len(stamps))
    arrivals = np.asarray(stream.arrivals_ns, np.int64) if has_arrivals else None
    is_unset, what = _unset(stream, stamps, arrivals)
    if not is_unset.any() or (arrivals is None and stream.kind not in TIMED_KINDS):
        return False
    if arrivals is None:
        if is_unset.mean() < MAX_UNSET:
            return False
        raise LogError(
            f"{stream.label}: {what}, and the log has no times of arrival: set them when recording, or give a CSV table "
            "stamps by row_stamps in its log.yaml"
        )
    is_known = stamps > 0 if stamps.max() > stamps.min() else np.zeros(len(stamps), np.bool_)
    late = (arrivals - stamps)[is_known]
    delay_ns = 0 if not len(late) else int(np.median(late) if UNEVEN in what else late.min())
    stream.stamps_ns = _valid(np.where(is_unset, arrivals - delay_ns, stamps))
    message_counts.find(f"{stream.label}: {what}: the times of arrival are used")
    return True


def _even_out(stream: RecordedStream, message_counts: MessageCounts) -> bool:
    """Replace jittering stamps of one stream by even ones, if its messages were measured evenly; returns whether it did."""
    if stream.kind not in TIMED_KINDS or len(stream.frames) > 1:
        return False
    found = evened(_stamps(stream))
    if found is None:
        return False
    stamps, std_s = found
    stream.stamps_ns = _valid(stamps)
    message_counts.find(
        f"{stream.label}: stamps jitter by {1e3 * std_s:.0f} ms about even ones: the even ones are used"
    )
    return True


def _unset(stream: RecordedStream, stamps: Stamps, arrivals: Stamps | None) -> tuple[NDArray[np.bool_], str]:
    """Mask `(n,)` of the unusable stamps of a stream, and the reason as a clause; "" without any."""
    is_zero = stamps == 0
    if is_zero.all():
        return is_zero, "all stamps are 0"
    if is_zero.any() and stamps[~is_zero].min() > MIN_SET_NS:
        return is_zero, f"{int(is_zero.sum())} stamps are 0"
    every = np.ones(len(stamps), np.bool_)
    if stream.kind in TIMED_KINDS and len(stream.frames) < 2 and len(stamps) >= MIN_STAMPS:
        if (np.diff(stamps) == 0).mean() > MAX_EQUAL:
            return every, "most stamps are those of the message before"
        once = ~copies_among(stamps)
        uneven = 0.0 if arrivals is None else _unevenness(stamps[once], arrivals[once])
        if uneven > MIN_UNEVENNESS:
            return every, f"{UNEVEN}, by {uneven:.0%} of their period, and the messages came evenly"
    return ~every, ""


def _unevenness(stamps: Stamps, arrivals: Stamps) -> float:
    """Unevenness of the steps of stamps `(n,)`, relative to their mean; 0 where the messages did not arrive far more evenly."""
    spans = [float(np.ptp(times)) for times in (stamps, arrivals)]
    steps = np.diff(stamps)
    is_same_clock = abs(spans[1] - spans[0]) <= MAX_SPAN_ERROR * spans[0]
    behind = np.maximum.accumulate(stamps) - stamps
    if not is_same_clock or np.quantile(behind, 0.95) > MAX_BEHIND_NS:  # the clock was set back
        return 0.0
    own, of_arrivals = (
        float(np.abs(one - np.median(one)).mean() / max(float(one.mean()), 1.0))
        for one in (steps, np.diff(arrivals))
    )
    return own if own > MIN_UNEVENNESS_RATIO * of_arrivals else 0.0


def check_overlap(
    streams: Sequence[RecordedStream], kind_of: Mapping[int, str], message_counts: MessageCounts
) -> None:
    """Raises LogError: the odometry covers hardly any of the scans, as where their clocks differ. Notes a partial overlap."""
    scans = [i for i, kind in kind_of.items() if kind == "scan" and len(streams[i].stamps_ns)]
    odometry = [i for i, kind in kind_of.items() if kind == "odom" and len(streams[i].stamps_ns)]
    if not scans or not odometry:
        return
    covered = _stamps(streams[odometry[0]])
    first, last = int(covered.min()), int(covered.max())
    for index in scans:
        stamps = _stamps(streams[index])
        is_covered = (stamps >= first - EDGE_NS) & (stamps <= last + EDGE_NS)
        fraction = float(is_covered.mean())
        if fraction >= FULL_OVERLAP:
            continue
        spans = (
            f"{streams[index].label} from {_seconds(int(stamps.min()))} to {_seconds(int(stamps.max()))} s, "
            f"{streams[odometry[0]].label} from {_seconds(first)} to {_seconds(last)} s"
        )
        if fraction < MIN_OVERLAP:
            raise LogError(
                f"scans and odometry hardly overlap in time: {spans}. Their clocks differ; record both with one clock, or "
                "leave the odometry out: log: {topics: {odom: []}}"
            )
        message_counts.find(f"odometry covers {fraction:.0%} of the scans: {spans}")


def find_silent_lidars(
    streams: Sequence[RecordedStream], kind_of: Mapping[int, str], message_counts: MessageCounts
) -> None:
    """Report lidars without scans in the first or the last part of a drive, as where a driver died."""
    spans = {
        i: _main_span_s(streams[i])
        for i, kind in kind_of.items()
        if kind in ("scan", "odom") and len(streams[i].stamps_ns)
    }
    for index, (first_s, last_s) in spans.items():
        if kind_of[index] != "scan":
            continue
        start_s, end_s = (f(s[k] for s in spans.values()) for k, f in enumerate((min, max)))
        for silent_s, part in ((first_s - start_s, "first"), (end_s - last_s, "last")):
            if silent_s > max(MIN_SILENT_S, MIN_SILENT_FRACTION * (end_s - start_s)):
                message_counts.find(
                    f"{streams[index].label}: no scans in the {part} {silent_s:.0f} s of the {end_s - start_s:.0f} s that "
                    "odometry and scans cover (the lidar was off, or its driver died)"
                )


def _main_span_s(stream: RecordedStream) -> tuple[float, float]:
    """First and last stamp (s) of a stream without its outermost stamps, which may be outliers."""
    stamps = np.sort(_stamps(stream))
    outer = min(OUTER_STAMPS, (len(stamps) - 1) // 2)
    return float(stamps[outer] * 1e-9), float(stamps[len(stamps) - 1 - outer] * 1e-9)


def _is_clock(arrivals_ns: array[int], count: int) -> bool:
    """Whether there are times of arrival, and they increase."""
    if len(arrivals_ns) != count or count < 2:
        return False
    steps = np.diff(np.asarray(arrivals_ns, np.int64))
    return bool(np.median(steps) > 0 and (steps >= 0).all())


def _clock_offset_ns(stream: RecordedStream) -> int | None:
    """Nanoseconds by which the recorder's clock is ahead of the stamps; None if the offset is not constant.

    Messages arrive with varying delays, never early, so the smallest difference is the offset of the clocks.
    """
    if not _is_clock(stream.arrivals_ns, len(stream.stamps_ns)):
        return None
    late = np.asarray(stream.arrivals_ns, np.int64) - _stamps(stream)
    half = len(late) // 2
    first, second = int(late[:half].min()), int(late[half:].min())
    limit = min(MAX_OFFSET_NS, MAX_DRIFT * float(np.ptp(_stamps(stream))))
    return min(first, second) if abs(first - second) <= limit else None


def _stamps(stream: RecordedStream) -> Stamps:
    return np.asarray(stream.stamps_ns, np.int64)


def _valid(stamps: Stamps) -> array[int]:
    """The stamps `(n,)`, those out of range at its end: a shift by another clock may lead there."""
    return array("q", np.clip(stamps, 0, END_NS - 1).tobytes())


def _seconds(stamp_ns: int) -> str:
    return f"{stamp_ns / NS_PER_S:.3f}"
