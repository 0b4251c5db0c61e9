"""Measurement times of sensors, and the stamps of their messages."""

from __future__ import annotations

import numpy as np

from gridslam.simulation.sensors.sensor_config import Stream


class Schedule:
    """Measurement times of a stream (ns since the start), and the stamps and losses of its messages."""

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
        """Time (ns) of the next measurement."""
        return round(self._phase_ns + self._count * self._period_ns)

    def is_due(self, now_ns: int) -> bool:
        """Whether the next measurement is due."""
        return self.next_ns <= now_ns

    def advance(self) -> None:
        """Count the measurement that is due, so that the next one is scheduled."""
        self._count += 1

    def stamp_ns(self, taken_ns: float) -> int | None:
        """The stamp (ns) of a measurement, or None if its message is lost. Stamps of a stream increase strictly."""
        delay, lost = float(self._rng.standard_normal()), float(self._rng.random())
        if lost < self._stream.missing:
            return None
        delay_ns = 1e9 * (self._stream.latency_s + self._stream.jitter_s * delay)
        stamp = self._start_ns + round(taken_ns + max(delay_ns, 0.0))
        self._last_stamp_ns = max(stamp, self._last_stamp_ns + 1)
        return self._last_stamp_ns
