from __future__ import annotations

import heapq
import random
import time
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridslam.logs.order import ordering

Streams = dict[int, list[int]]
streams = st.dictionaries(st.integers(0, 3), st.lists(st.integers(0, 40), max_size=12), max_size=4)


def merged(stamps: Streams, by_stamp: bool) -> list[tuple[int, int]]:
    """The slow reference: (stream, place in it), merged by heapq with the key written out."""

    def keyed(precedence: int, stream: int) -> Iterator[tuple[int, int, int, int, tuple[int, int]]]:
        largest = detour = 0
        is_behind = False
        entries = list(enumerate(stamps[stream]))
        if by_stamp:
            entries.sort(key=lambda entry: entry[1])
        for order, (place, stamp) in enumerate(entries):
            if stamp > largest:
                largest, detour, is_behind = stamp, 0, False
            is_behind = is_behind or stamp < largest
            if is_behind:
                detour = max(detour, stamp)
            yield (
                stamp if by_stamp else largest,
                0 if by_stamp else detour,
                precedence,
                order,
                (stream, place),
            )

    return [entry[-1] for entry in heapq.merge(*(keyed(p, s) for p, s in enumerate(stamps)))]


def played_back(
    stamps: Streams, recorded: list[int], by_stamp: bool, limit: int = 1 << 30
) -> tuple[list, list[int]]:
    """(played_back items, streams of late ones); an item is (stream, place in it)."""
    ranks, _ = ordering.merge_plan(stamps, by_stamp)
    places = dict.fromkeys(stamps, -1)

    def items() -> Iterator[tuple[int, int]]:
        for stream in recorded:
            places[stream] += 1
            yield stream, places[stream]

    late: list[int] = []
    return list(ordering.in_planned_order(items(), ranks, lambda item: 1, limit, late.append)), late


@given(streams, st.booleans(), st.randoms(use_true_random=False))
def test_the_order_is_that_of_a_merge_whatever_the_file_interleaves(
    stamps: Streams, by_stamp: bool, shuffle: random.Random
) -> None:
    recorded = [stream for stream, listed in stamps.items() for _ in listed]
    shuffle.shuffle(recorded)
    items, late = played_back(stamps, recorded, by_stamp)
    assert items == merged(stamps, by_stamp)
    assert not late


@given(streams, st.randoms(use_true_random=False), st.integers(0, 3))
def test_with_little_memory_nothing_is_lost_and_the_recorded_order_within_a_stream_holds(
    stamps: Streams, shuffle: random.Random, limit: int
) -> None:
    recorded = [stream for stream, listed in stamps.items() for _ in listed]
    shuffle.shuffle(recorded)
    items, late = played_back(stamps, recorded, False, limit)
    assert sorted(items) == sorted(merged(stamps, False))
    for stream in stamps:
        assert [place for s, place in items if s == stream] == sorted(p for s, p in items if s == stream)
    assert len(late) <= len(items)


def test_an_out_of_order_stamp_remains_in_its_recorded_place() -> None:
    stamps = {0: [10, 30, 20, 40], 1: [25, 35]}
    items, _ = played_back(stamps, [0, 1, 0, 1, 0, 0], False)
    assert items == [(0, 0), (1, 0), (0, 1), (0, 2), (1, 1), (0, 3)]
    assert ordering.out_of_order_stamps(stamps[0]) == 1


def test_one_stamp_far_in_the_future_does_not_hold_back_its_stream() -> None:
    second = 10**9
    outlier = [0, second, 5000 * second, 2 * second, 3 * second]
    assert ordering.outlier_places(outlier) == {2}
    items, _ = played_back({0: outlier, 1: [int(2.5 * second)]}, [0, 0, 0, 0, 1, 0], False)
    assert items == [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0), (0, 4)]


@pytest.mark.parametrize("stamps", [[0, 100 * 10**9, 200 * 10**9], [0, 1, 2, 100 * 10**9], [5], []])
def test_a_pause_is_no_outlier_stamp(stamps: list[int]) -> None:
    assert not ordering.outlier_places(stamps)


def test_equal_stamps_are_counted() -> None:
    assert ordering.repeated_stamps([1, 1, 2, 2, 2, 1]) == 3


SECOND = 10**9


def test_where_the_clock_steps_back_the_streams_remain_interleaved() -> None:
    scans = [*range(0, 10 * SECOND, SECOND // 10), *range(4 * SECOND, 12 * SECOND, SECOND // 10)]
    odometry = [
        *range(SECOND // 50, 10 * SECOND, SECOND // 50),
        *range(4 * SECOND, 12 * SECOND, SECOND // 50),
    ]
    _, schedule = ordering.merge_plan({0: odometry, 1: scans}, False)
    places = [i for i, stream in enumerate(schedule) if stream == 1]
    assert max(b - a for a, b in pairwise(places)) <= 6


def test_a_stream_that_is_too_slow_to_show_a_clock_step_remains_after_it() -> None:
    fast = [*range(0, 10 * SECOND, SECOND // 10), *range(5 * SECOND, 30 * SECOND, SECOND // 10)]
    other = [stamp + 1 for stamp in fast]
    slow = [2 * SECOND, 8 * SECOND, 14 * SECOND, 20 * SECOND]
    _, schedule = ordering.merge_plan({0: fast, 1: other, 2: slow}, False)
    places = [i for i, stream in enumerate(schedule) if stream == 2]
    assert places[2] > 200 + 2 * 85


def test_one_stream_that_steps_back_alone_does_not_reorder_the_others() -> None:
    steady = list(range(0, 20 * SECOND, SECOND // 10))
    stepping = [*range(0, 10 * SECOND, SECOND), *range(5 * SECOND, 20 * SECOND, SECOND)]
    _, schedule = ordering.merge_plan({0: steady, 1: stepping}, False)
    places = [i for i, stream in enumerate(schedule) if stream == 1]
    assert places[-1] > len(schedule) - 15


def test_out_of_order_stamps_of_two_streams_are_merged_too() -> None:
    _, schedule = ordering.merge_plan({0: [100, 98, 99, 101], 1: [100, 98, 99, 101]}, False)
    assert list(schedule) == [0, 1] * 4


def test_streams_recorded_one_after_the_other_cost_no_search_for_each_event_that_waits() -> None:
    count = 60_000
    stamps = {stream: [2 * place + stream for place in range(count)] for stream in (0, 1)}
    started = time.process_time()
    items, late = played_back(stamps, [0] * count + [1] * count, False, count // 2)
    assert time.process_time() - started < 3.0  # with a search each, a minute
    assert len(items) == 2 * count
    assert 0 < len(late) <= count // 2
