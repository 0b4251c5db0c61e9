"""The front end's track in the place of the particle filter, for runs that do not use the filter's result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]


class SingleTrack:
    """One particle without noise and without a map; it starts at the origin and follows the front end."""

    best = 0
    next_inserted: int | None = None
    resamplings = 0
    redrawn_maps = 0
    memory_mb = 0.0

    def __init__(self) -> None:
        self._path: list[Floats] = []

    @property
    def poses(self) -> Floats:
        """The present pose `(1, 3)`."""
        return self._path[-1][None] if self._path else np.zeros((1, 3))

    @property
    def best_trajectory(self) -> Floats:
        """The poses `(k, 3)` at all key scans."""
        return np.array(self._path).reshape(-1, 3)

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
        self._path.append(se2.compose(self._path[-1], step) if self._path else np.zeros(3))

    def replace_scan(self, key: int, scan: PreparedScan) -> None:
        """Do nothing: there is no map that a scan could enter."""

    def add_evidence(self, log_likelihood: Floats) -> None:
        """Do nothing: a single track has no weights `(1,)` to change."""
