"""The order of events: streams merged by stamp, exactly, holding back only what was recorded too early.

All stamps are known before the first event (8 bytes each), so the place of every event in the merged order is
computed beforehand, and reading needs no look-ahead. The key of an event is the largest stamp that its stream has had
so far: within a stream the recorded order wins over out-of-order stamps. Where the clock itself jumps back, so that
several streams do, the merge starts again (`gridslam.logs.order.clock_steps`).
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
    """Number of stamps that are smaller than the one before."""
    return int(np.count_nonzero(np.diff(np.asarray(stamps_ns, dtype=np.int64)) < 0))


def repeated_stamps(stamps_ns: Sequence[int]) -> int:
    """Number of stamps that equal the one before."""
    return int(np.count_nonzero(np.diff(np.asarray(stamps_ns, dtype=np.int64)) == 0))


def outlier_places(stamps_ns: Sequence[int]) -> frozenset[int]:
    """Places of single stamps that are more than OUTLIER_S from both neighbours, which agree with each other.

    One such stamp in the future would put the rest of its stream behind all other streams.
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
    """The place of every event and the stream at every place.

    `stamps_by_stream` is ordered by precedence at equal keys. Returns `ranks[stream][i]`, the place of the
    stream's i-th event, and `schedule[place]`, the stream. `by_stamp` sorts within a stream as well
    (stable).
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
    """The stamps `(n,)` (ns), each outlier replaced by the stamp before it."""
    stamps = np.array(stamps_ns, dtype=np.int64)
    places = np.array(sorted(outlier_places(stamps_ns)), dtype=np.int64)
    stamps[places] = stamps[places - 1]
    return stamps


def _keys_in_epochs(
    stamps: NDArray[np.int64], epochs: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The key of each event of a stream, and what sorts events of one key.

    The key is the largest stamp of the epoch so far. The second number is 0 up to the first out-of-order stamp of a
    key, then the largest stamp since: out-of-order stamps of several streams are merged as well.
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
    """The items, which arrive as (stream, item), in the order of their places `ranks[stream][i]`.

    An item that arrives early waits. When more than `limit_bytes` wait, the earliest of them is passed on although an
    item before it is still missing; that one is passed on as soon as it arrives, after a call of `on_late(stream)`.
    """
    places = {stream: iter(rank) for stream, rank in ranks.items()}
    waiting: dict[int, tuple[int, T]] = {}
    # A heap of the places in `waiting`, and of some that were, once it is needed
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
