"""Events in the order of their stamps, where the stamps of some have been moved."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from gridslam.core.messages import Event


class StampOrder:
    """Sorts events by stamp; each waits until no event that is `late_ns` late can precede it. Equal stamps keep their order."""

    def __init__(self, late_ns: int) -> None:
        self._late_ns = late_ns
        self._held: list[tuple[int, int, Event]] = []
        self._count = 0

    def add(self, event: Event, recorded_ns: int) -> Iterator[Event]:
        """Process an event that was recorded with another stamp; yields what need not wait any more."""
        heapq.heappush(self._held, (event.stamp_ns, self._count, event))
        self._count += 1
        while self._held and self._held[0][0] <= recorded_ns - self._late_ns:
            yield heapq.heappop(self._held)[2]

    def flush(self) -> Iterator[Event]:
        """The events that are still held."""
        while self._held:
            yield heapq.heappop(self._held)[2]
