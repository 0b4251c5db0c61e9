"""Stamps that were never set, and clocks that differ: times of arrival help, and where there are none it is an error."""

from __future__ import annotations

from array import array

import numpy as np
import pytest

from gridslam.core.errors import LogError
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.order.clocks import check_overlap, find_silent_lidars, restamp
from gridslam.logs.streams import RecordedStream

S = 10**9
START = 1_700_000_000 * S
ARRIVALS = START + np.arange(100) * (S // 10)
DELAY = 30_000_000


def stream(kind: str, stamps: np.ndarray, arrivals: np.ndarray | None = ARRIVALS) -> RecordedStream:
    found = RecordedStream(kind, f"/{kind}", "type", stamps_ns=array("q", stamps.tolist()))
    found.arrivals_ns = array("q", [] if arrivals is None else arrivals.tolist())
    return found


def repaired(*streams: RecordedStream) -> tuple[list[np.ndarray], MessageCounts]:
    counts = MessageCounts()
    restamp(streams, {i: s.kind for i, s in enumerate(streams)}, counts)
    return [np.array(s.stamps_ns) for s in streams], counts


def test_stamps_that_are_all_zero_become_times_of_arrival() -> None:
    (scans, odometry), counts = repaired(
        stream("scan", np.zeros(100, np.int64)), stream("odom", ARRIVALS - DELAY)
    )
    assert (scans == ARRIVALS).all()
    assert (odometry == ARRIVALS - DELAY).all()
    assert counts.problems == ["/scan: all stamps are 0: the times of arrival are used"]


@pytest.mark.parametrize("arrivals", [None, np.zeros(100, np.int64)])
def test_stamps_that_are_all_zero_are_an_error_without_times_of_arrival(arrivals: np.ndarray | None) -> None:
    with pytest.raises(LogError, match="all stamps are 0"):
        repaired(stream("scan", np.zeros(100, np.int64), arrivals))


@pytest.mark.parametrize("offset_s", [-1_699_999_900, -30, 30])
@pytest.mark.parametrize("kind", ["scan", "odom"])
def test_a_stream_of_another_clock_is_shifted_to_the_recorders(offset_s: int, kind: str) -> None:
    other = {"scan": "odom", "odom": "scan"}[kind]
    shifted, right = stream(kind, ARRIVALS - DELAY + offset_s * S), stream(other, ARRIVALS - DELAY)
    (found, untouched), counts = repaired(shifted, right)
    assert (found == ARRIVALS).all()
    assert (untouched == ARRIVALS - DELAY).all()
    assert len(counts.problems) == 1


def test_streams_of_one_clock_are_unchanged_whatever_the_recorder_had() -> None:
    simulated = np.arange(100) * (S // 10)
    streams, counts = repaired(stream("scan", simulated), stream("odom", simulated + DELAY))
    assert (streams[0] == simulated).all()
    assert not counts.problems


def test_times_of_arrival_that_run_at_another_pace_are_not_believed() -> None:
    slow = ARRIVALS[:1] + (ARRIVALS - START) // 100
    streams, counts = repaired(stream("scan", ARRIVALS - 60 * S, slow), stream("odom", ARRIVALS, slow))
    assert (streams[0] == ARRIVALS - 60 * S).all()
    assert not counts.problems


def overlap(scans: np.ndarray, odometry: np.ndarray) -> list[str]:
    counts = MessageCounts()
    check_overlap([stream("scan", scans), stream("odom", odometry)], {0: "scan", 1: "odom"}, counts)
    return counts.problems


def test_scans_without_odometry_at_their_time_are_an_error_with_both_spans() -> None:
    with pytest.raises(LogError, match=r"1699999900\.000 to 1699999909\.900 s.*1700000000\.000 to"):
        overlap(ARRIVALS - 100 * S, ARRIVALS)


@pytest.mark.parametrize(
    ("scans", "says"),
    [
        (ARRIVALS, None),
        (ARRIVALS[: len(ARRIVALS) // 3], "no scans in the last 7 s of the 10 s"),
        (ARRIVALS[2 * len(ARRIVALS) // 3 :], "no scans in the first 7 s of the 10 s"),
        (np.append(ARRIVALS, ARRIVALS[-1] + 60 * S), None),
    ],
)
def test_a_lidar_that_dies_or_starts_late_is_reported(scans: np.ndarray, says: str | None) -> None:
    counts = MessageCounts()
    streams = [stream("scan", scans), stream("odom", ARRIVALS)]
    find_silent_lidars(streams, {0: "scan", 1: "odom"}, counts)
    assert len(counts.problems) == (says is not None)
    assert says is None or says in counts.problems[0]


def test_a_partial_overlap_is_noted_and_a_full_one_is_not() -> None:
    assert "covers 40% of the scans" in overlap(ARRIVALS - 7 * S, ARRIVALS)[0]
    assert not overlap(ARRIVALS, ARRIVALS[20:])


@pytest.mark.parametrize("kind", ["scan", "odom"])
def test_stamps_that_say_nothing_now_and_then_are_filled_in(kind: str) -> None:
    stamps = ARRIVALS - DELAY
    stamps[::2] = 0
    (found,), counts = repaired(stream(kind, stamps))
    assert (found == ARRIVALS - DELAY).all()
    assert "50 stamps are 0" in counts.problems[0]
    assert counts.has_findings


@pytest.mark.parametrize(
    "stamps",
    [
        np.full(100, START),  # all the same
        ARRIVALS // S * S,  # whole seconds
        ARRIVALS // S * S + ARRIVALS % S // 1000,  # microseconds as nanoseconds
        START + (ARRIVALS - START) // (4 * S // 10) * (4 * S // 10),  # bursts of four
    ],
)
def test_stamps_that_are_no_times_are_replaced(stamps: np.ndarray) -> None:
    (found,), counts = repaired(stream("scan", stamps))
    assert len(set(np.diff(found))) == 1
    assert len(counts.problems) == 1
    with pytest.raises(LogError, match="row_stamps"):
        repaired(stream("scan", ARRIVALS // S * S, None))


def test_arrivals_in_bursts_leave_even_stamps_alone() -> None:
    bursts = START + (ARRIVALS - START) // S * S + DELAY
    (found,), counts = repaired(stream("scan", ARRIVALS, bursts))
    assert (found == ARRIVALS).all()
    assert not counts.problems


def test_no_shift_leads_before_the_first_valid_stamp() -> None:
    arrivals = np.arange(100) * (S // 10)
    stamps = arrivals + 30 * S
    stamps[0] -= 50_000_000  # the first message came 50 ms late, at 0 of the recorder's clock
    (found, _), _ = repaired(stream("scan", stamps, arrivals), stream("odom", arrivals, arrivals))
    assert found[0] == 0
    assert (found[1:] == arrivals[1:]).all()
