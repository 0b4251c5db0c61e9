"""When a sensor speaks, and which stamp its messages carry."""

from __future__ import annotations

import numpy as np

from gridslam.simulation.sensor_config import Stream


class Schedule:
    """Moments of a stream (ns since the beginning), and the stamps and losses of its messages."""

    def __init__(self, stream: Stream, start_ns: int, rng: np.random.Generator, phase: float = 0.0) -> None:
        self._period_ns = 1e9 / stream.rate_hz
        self._stream = stream
        self._start_ns = start_ns
        self._rng = rng
        self._phase_ns = phase * self._period_ns
        self._count = 0
        self._last_stamp_ns = -1

    @property
    def next_ns(self) -> int:
        """When the next message is taken."""
        return round(self._phase_ns + self._count * self._period_ns)

    def is_due(self, now_ns: int) -> bool:
        """Whether the next message is to be taken now."""
        return self.next_ns <= now_ns

    def take(self) -> None:
        """Go on to the next message."""
        self._count += 1

    def stamp_ns(self, taken_ns: float) -> int | None:
        """The stamp of a message taken at a moment; None where the message is lost. Stamps of a stream only grow."""
        late, lost = float(self._rng.standard_normal()), float(self._rng.random())
        if lost < self._stream.missing:
            return None
        delay_ns = 1e9 * (self._stream.latency_s + self._stream.jitter_s * late)
        stamp = self._start_ns + round(taken_ns + max(delay_ns, 0.0))
        self._last_stamp_ns = max(stamp, self._last_stamp_ns + 1)
        return self._last_stamp_ns
