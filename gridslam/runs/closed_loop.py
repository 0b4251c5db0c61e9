"""The closed loop of simulator, estimator and explorer, in steps of a tenth of a second.

The estimator receives the events in the order of their stamps, slightly delayed.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Literal, Protocol

from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.methods.base import Method, RunResult
from gridslam.runs.feed import Clock, Progress, Show, Stop
from gridslam.simulation.driving.contact import ContactWatch
from gridslam.simulation.simulator import Simulator

STEPS_PER_COMMAND = 10  # number of steps of 10 ms per command
MAX_DELAY_NS = 250_000_000  # longest delay of a message after its stamp

Ending = Literal["finished", "contact", "time", "interrupted"]


class WheelCommand(Protocol):
    """Speeds of the wheels along the ground."""

    @property
    def left_mps(self) -> float:
        """Speed (m/s) of the left wheel."""

    @property
    def right_mps(self) -> float:
        """Speed (m/s) of the right wheel."""


class Explores(Protocol):
    """The part of a method that drives the robot."""

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to observe."""

    def add(self, event: Event) -> None:
        """Process an event as it arrives."""

    def command(self) -> WheelCommand:
        """Wheel speeds for the next period."""

    def add_to(self, result: RunResult) -> RunResult:
        """The estimator's result with those of the exploration."""


class InStampOrder:
    """Releases events in the order of their stamps, a fixed delay after them."""

    def __init__(self, delay_ns: int) -> None:
        self._delay_ns = delay_ns
        self._waiting: list[tuple[int, int, Event]] = []
        self._count = 0

    def add(self, event: Event) -> None:
        """Add an event."""
        heapq.heappush(self._waiting, (event.stamp_ns, self._count, event))
        self._count += 1

    def ready(self, now_ns: int) -> Iterator[Event]:
        """The events that are due, removed."""
        while self._waiting and self._waiting[0][0] <= now_ns - self._delay_ns:
            yield heapq.heappop(self._waiting)[2]

    def rest(self) -> Iterator[Event]:
        """All remaining events, removed."""
        while self._waiting:
            yield heapq.heappop(self._waiting)[2]


class ClosedLoop:
    """Runs the closed loop and stores the result in its attributes."""

    def __init__(
        self,
        simulator: Simulator,
        method: Method,
        explorer: Explores,
        show: Show,
        limit_s: float,
        now: Clock,
    ) -> None:
        self.simulator, self._method, self._explorer = simulator, method, explorer
        self._show, self._limit_s, self._now = show, limit_s, now
        self._order = InStampOrder(MAX_DELAY_NS)
        self.watch = ContactWatch(simulator)
        self.path: list[Odometry] = []
        self.counts: Counter[str] = Counter()
        self.ended: Ending = "interrupted"
        self.process_s = 0.0
        self.events = self.scans = 0

    def drive(
        self, write: Callable[[Event], None], write_truth: Callable[[Odometry], None], stop: Stop
    ) -> None:
        """Run until the explorer has finished, the time is over, the robot touches something, or `stop` returns True."""
        for extrinsics in self.simulator.extrinsics():
            self._add_event(extrinsics, write)
        self._record_truth(write_truth)
        while not self._is_over(stop):
            started = self._now()
            command = self._explorer.command()
            self.process_s += self._now() - started
            self._step(command, write)
            self._record_truth(write_truth)
        for event in self._order.rest():
            self._method.process(event)

    def _is_over(self, stop: Stop) -> bool:
        if self.watch.is_touching:
            self.ended = "contact"
        elif self._explorer.is_finished:
            self.ended = "finished"
        elif self.simulator.time_s >= self._limit_s:
            self.ended = "time"
        elif not stop():
            return False
        return True

    def _step(self, command: WheelCommand, write: Callable[[Event], None]) -> None:
        """Drive for a tenth of a second, and pass the events to estimator and explorer."""
        radius = self.simulator.world.robot.wheels.radius_m
        for _ in range(STEPS_PER_COMMAND):
            for event in self.simulator.step(command.left_mps / radius, command.right_mps / radius):
                self._add_event(event, write)
            if self.watch.is_touching:
                break
        started = self._now()
        now_ns = self.simulator.world.start_ns + round(self.simulator.time_s * 1e9)
        for event in self._order.ready(now_ns):
            self._method.process(event)
        self.process_s += self._now() - started
        self._show(Progress(self.events, max(self.events, 1), self.scans))

    def _add_event(self, event: Event, write: Callable[[Event], None]) -> None:
        write(event)
        self.events += 1
        if isinstance(event, LaserScan):
            self.scans += 1
            self.counts["read.scan"] += 1
        elif isinstance(event, Odometry):
            self.counts["read.odom"] += 1
        self._order.add(event)
        self._explorer.add(event)

    def _record_truth(self, write_truth: Callable[[Odometry], None]) -> None:
        pose = self.simulator.truth()
        write_truth(pose)
        self.path.append(pose)
