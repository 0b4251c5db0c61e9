"""The order of events: streams are merged by stamp, and only events that were recorded too early are held back.

All stamps are known before the first event is read (8 bytes each), so the position of every event in the merged order is computed
in advance. Events are sorted by a key: the largest stamp of their stream up to them. So events of one stream keep their recorded
order even if stamps are out of order. If several streams jump back together, their clock was set back, and the merge starts again
(`gridslam.logs.order.clock_steps`).
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import NS_PER_S
from gridslam.logs.order.clock_steps import clock_epochs

T = TypeVar("T")
OUTLIER_S = 60


def out_of_order_stamps(stamps_ns: Sequence[int]) -> int:
    """Number of stamps that are smaller than the previous one."""
    return int(np.count_nonzero(np.diff(np.asarray(stamps_ns, dtype=np.int64)) < 0))


def repeated_stamps(stamps_ns: Sequence[int]) -> int:
    """Number of stamps that equal the previous one."""
    return int(np.count_nonzero(np.diff(np.asarray(stamps_ns, dtype=np.int64)) == 0))


def outlier_places(stamps_ns: Sequence[int]) -> frozenset[int]:
    """Indices of single stamps that differ by more than OUTLIER_S from both neighbours, which agree with each other.

    One such stamp in the future would move the rest of its stream behind all other streams.
    """
    stamps = np.asarray(stamps_ns, dtype=np.int64)
    if len(stamps) < 3:
        return frozenset()
    before, here, after = stamps[:-2], stamps[1:-1], stamps[2:]
    limit = OUTLIER_S * NS_PER_S
    off = ((here - before > limit) & (here - after > limit)) | (
        (before - here > limit) & (after - here > limit)
    )
    return frozenset((np.flatnonzero(off & (np.abs(after - before) <= limit)) + 1).tolist())


def merge_plan(
    stamps_by_stream: Mapping[int, Sequence[int]], by_stamp: bool
) -> tuple[dict[int, array[int]], array[int]]:
    """The merged order of all events.

    Of events with equal keys, those of earlier streams in `stamps_by_stream` come first. With `by_stamp`, events are sorted by
    stamp within each stream as well (stable). Returns `ranks[stream][i]`, the position of the stream's i-th event, and
    `schedule[position]`, its stream.
    """
    if not stamps_by_stream:
        return {}, array("q")
    stamps = [without_outliers(s) for s in stamps_by_stream.values()]
    owner = np.repeat(np.array(list(stamps_by_stream), dtype=np.int64), [len(s) for s in stamps])
    if by_stamp:
        keys = np.concatenate(stamps)
        order = np.argsort(keys, kind="stable")
    else:
        epochs = clock_epochs(stamps)
        parts = [_keys_in_epochs(s, e) for s, e in zip(stamps, epochs, strict=True)]
        keys, detours = (np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((detours, keys, np.concatenate(epochs)))
    place = np.empty(len(keys), dtype=np.int64)
    place[order] = np.arange(len(keys))
    ends = np.cumsum([len(s) for s in stamps])
    ranks = {
        stream: array("q", place[end - len(s) : end].tobytes())
        for stream, s, end in zip(stamps_by_stream, stamps, ends, strict=True)
    }
    return ranks, array("q", owner[order].tobytes())


def without_outliers(stamps_ns: Sequence[int]) -> NDArray[np.int64]:
    """The stamps `(n,)` (ns), with each outlier replaced by the previous stamp."""
    stamps = np.array(stamps_ns, dtype=np.int64)
    places = np.array(sorted(outlier_places(stamps_ns)), dtype=np.int64)
    stamps[places] = stamps[places - 1]
    return stamps


def _keys_in_epochs(
    stamps: NDArray[np.int64], epochs: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The key of each event of a stream, and a second key for events with equal keys.

    The key is the largest stamp of the epoch so far. The second key is 0 up to the first out-of-order stamp after a key, and then
    the largest stamp since, so that out-of-order stamps of several streams are merged as well.
    """
    keys = np.empty_like(stamps)
    detours = np.zeros_like(stamps)
    starts = np.flatnonzero(np.diff(epochs, prepend=-1)).tolist()
    for start, end in zip(starts, [*starts[1:], len(stamps)], strict=False):
        keys[start:end] = np.maximum.accumulate(stamps[start:end])
    changes = (np.diff(keys) != 0) | (np.diff(epochs) != 0)
    group_ends = np.append(np.flatnonzero(changes) + 1, len(stamps))
    end = 0
    for first in np.flatnonzero(stamps < keys).tolist():
        if first >= end:
            end = int(group_ends[np.searchsorted(group_ends, first, side="right")])
            detours[first:end] = np.maximum.accumulate(stamps[first:end])
    return keys, detours


def in_planned_order(
    items: Iterator[tuple[int, T]],
    ranks: Mapping[int, array[int]],
    size_of: Callable[[T], int],
    limit_bytes: int,
    on_late: Callable[[int], None],
) -> Iterator[tuple[int, T]]:
    """The pairs (stream, item) in the order of their positions `ranks[stream][i]`.

    An item that arrives early waits. When more than `limit_bytes` wait, the earliest one is yielded although items before it are
    missing. Each of these is yielded as soon as it arrives, after a call of `on_late(stream)`.
    """
    places = {stream: iter(rank) for stream, rank in ranks.items()}
    waiting: dict[int, tuple[int, T]] = {}
    # A heap of the positions in `waiting`, and some that were yielded already; made when it is needed first
    earliest: list[int] | None = None
    waiting_bytes = 0
    expected = 0
    for item in items:
        place = next(places[item[0]], None)
        if place is None:  # more items than planned: the file has grown since
            break
        if place == expected:
            yield item
            expected += 1
        elif place < expected:
            on_late(item[0])
            yield item
            continue
        else:
            waiting[place] = item
            waiting_bytes += size_of(item[1])
            if earliest is not None:
                heappush(earliest, place)
            if waiting_bytes > limit_bytes:
                earliest = sorted(waiting) if earliest is None else earliest
                while earliest[0] not in waiting:
                    heappop(earliest)
                expected = earliest[0]
        while expected in waiting:
            held = waiting.pop(expected)
            waiting_bytes -= size_of(held[1])
            yield held
            expected += 1
    for place in sorted(waiting):
        yield waiting[place]
