"""Passes the events of a log to a method, with progress, times and a way to stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

from gridslam.core.messages import Event, LaserScan
from gridslam.logs.log import Log
from gridslam.methods.base import Method
from gridslam.runs.odometry_path import OdometryPath

MAX_BATCH = 256
SHORT_BATCH_S = 0.01
LONG_BATCH_S = 0.04


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a run: events processed so far, an upper bound of their total, and the scans among those processed.

    `is_finishing`: all events are processed, and the method computes its result.
    """

    events: int
    max_events: int
    scans: int
    is_finishing: bool = False


Show = Callable[[Progress], None]
Stop = Callable[[], bool]
Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class FeedResult:
    """Times (s) of reading and processing, numbers of events and scans, the odometry, and whether the run was stopped."""

    read_s: float
    process_s: float
    events: int
    scans: int
    odometry: OdometryPath
    stopped: bool


def feed(log: Log, method: Method, show: Show, stop: Stop, now: Clock = time.perf_counter) -> FeedResult:
    """Pass all events to the method in order, in batches, so that the clock is read rarely and a stop takes effect soon.

    A batch grows if it takes less than 10 ms and shrinks if it takes more than 40 ms. Its size affects only the granularity of
    timing and progress.
    """
    events: Iterator[Event] = iter(log.events())
    process = method.process
    read_s = process_s = 0.0
    done = scans = 0
    odometry = OdometryPath()
    size, max_events = 1, log.event_count
    while not stop():
        t0 = now()
        batch = list(islice(events, size))
        t1 = now()
        for event in batch:
            process(event)
        t2 = now()
        read_s += t1 - t0
        process_s += t2 - t1
        if not batch:
            return FeedResult(read_s, process_s, done, scans, odometry, stopped=False)
        done += len(batch)
        scans += sum(isinstance(event, LaserScan) for event in batch)
        odometry.add(batch)
        show(Progress(done, max_events, scans))
        if t2 - t0 < SHORT_BATCH_S:
            size = min(2 * size, MAX_BATCH)
        elif t2 - t0 > LONG_BATCH_S:
            size = max(size // 2, 1)
    return FeedResult(read_s, process_s, done, scans, odometry, stopped=True)
