from __future__ import annotations

import heapq
import random
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridslam.logs import ordering

Streams = dict[int, list[int]]
streams = st.dictionaries(st.integers(0, 3), st.lists(st.integers(0, 40), max_size=12), max_size=4)


def merged(stamps: Streams, by_stamp: bool) -> list[tuple[int, int]]:
    """The slow reference: (stream, place in it), merged by heapq with the key written out."""

    def keyed(precedence: int, stream: int) -> Iterator[tuple[int, int, int, tuple[int, int]]]:
        largest = 0
        entries = list(enumerate(stamps[stream]))
        if by_stamp:
            entries.sort(key=lambda entry: entry[1])
        for order, (place, stamp) in enumerate(entries):
            largest = max(largest, stamp)
            yield stamp if by_stamp else largest, precedence, order, (stream, place)

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


def test_a_step_back_stays_in_its_recorded_place() -> None:
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
