"""A substitute for the particle filter that follows the front end, for runs that do not need the filter's result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]

FIRST_KEY_SCANS = 64  # initial capacity, which is doubled when it is used up


class SingleTrack:
    """One particle without noise and without a map; it starts at the origin and follows the front end."""

    best = 0
    next_inserted: int | None = None
    resamplings = 0
    redrawn_maps = 0
    memory_mb = 0.0

    def __init__(self) -> None:
        self._path = np.zeros((FIRST_KEY_SCANS, 3))
        self._count = 0

    @property
    def poses(self) -> Floats:
        """The current pose `(1, 3)`."""
        return self._path[max(self._count - 1, 0) : max(self._count, 1)]

    @property
    def best_trajectory(self) -> Floats:
        """The poses `(k, 3)` at all key scans; a view and not a copy, because it is read at each of them."""
        return self._path[: self._count]

    @property
    def trajectories(self) -> Floats:
        """Trajectories of all particles `(1, k, 3)`: the single track."""
        return self.best_trajectory[None]

    @property
    def diagnostics(self) -> dict[str, float]:
        """Empty: there is no distribution."""
        return {}

    def add_key_scan(self, scan: PreparedScan, step: Floats, step_std: Floats) -> None:
        """Move by the step `(3,)`."""
        if self._count == len(self._path):
            self._path = np.concatenate([self._path, np.zeros_like(self._path)])
        if self._count:
            self._path[self._count] = se2.compose(self._path[self._count - 1], step)
        self._count += 1

    def replace_scan(self, key: int, scan: PreparedScan) -> None:
        """Do nothing: there is no map."""

    def add_evidence(self, log_likelihood: Floats) -> None:
        """Do nothing: a single track has no weights."""
