"""Snapshots of a method's particles over time, few enough to keep in memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event
from gridslam.core.stamps import NS_PER_S
from gridslam.methods.base import Estimate, Method, RunResult


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Particles `(n, 3)` at one time: x, y, yaw in the map frame, as the method estimated them then."""

    stamp_ns: int
    particles: NDArray[np.float32]


class ParticleHistory:
    """Wraps a method, and keeps `max_particles` of its particles once a second of the log's time.

    In a log of more than `max_snapshots` seconds snapshots are less frequent, which bounds the memory. They depend on the log
    alone, not on how fast it is read.
    """

    def __init__(self, method: Method, max_snapshots: int = 2000, max_particles: int = 500) -> None:
        self._method = method
        self._max_snapshots = max_snapshots
        self._max_particles = max_particles
        self._interval_ns = NS_PER_S
        self._last_ns: int | None = None
        self._kept: list[Snapshot] = []

    @property
    def snapshots(self) -> tuple[Snapshot, ...]:
        """The snapshots in the order of the log; empty for a method without particles."""
        return tuple(self._kept)

    @property
    def estimate(self) -> Estimate | None:
        """The estimate of the wrapped method."""
        return self._method.estimate

    def process(self, event: Event) -> None:
        """Let the method process the event, and take a snapshot if one is due."""
        self._method.process(event)
        if self._last_ns is None or event.stamp_ns >= self._last_ns + self._interval_ns:
            self._look()

    def result(self) -> RunResult:
        """The result of the wrapped method."""
        return self._method.result()

    def _look(self) -> None:
        estimate = self._method.estimate
        if estimate is None or estimate.particles is None or not len(estimate.particles):
            return
        if self._last_ns is not None and estimate.stamp_ns < self._last_ns + self._interval_ns:
            return  # it is too early for another snapshot
        self._last_ns = estimate.stamp_ns
        step = -(-len(estimate.particles) // self._max_particles)
        particles = np.asarray(estimate.particles[::step], dtype=np.float32)
        self._kept.append(Snapshot(estimate.stamp_ns, particles))
        if len(self._kept) > self._max_snapshots:
            self._kept = self._kept[::2]
            self._interval_ns *= 2
