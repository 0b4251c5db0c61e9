"""What is kept of every pose, and how it is told."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.filters.particles import Belief
from gridslam.methods.base import Series, Table
from gridslam.methods.ispace_mcl.localizer import Update

COLUMNS = (
    "stamp",
    "x",
    "y",
    "yaw",
    "var_x",
    "var_y",
    "var_yaw",
    "confidence",
    "fit",
    "spread",
    "spread_all",
    "n_particles",
    "status",
)


class Record:
    """A row for every scan; scans between updates carry the assessment of the last one."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[np.ndarray] = []
        self._updates: list[Update] = []

    def add(self, stamp_ns: int, pose: np.ndarray, update: Update) -> None:
        """Take in the pose `(3,)` at a scan's stamp and the last update before it."""
        self._stamps.append(stamp_ns)
        self._poses.append(pose)
        self._updates.append(update)

    def trajectory(self) -> Trajectory:
        """All poses in the order of the scans."""
        if not self._stamps:
            return Trajectory.empty()
        return Trajectory(np.array(self._stamps, np.int64), np.array(self._poses))

    def table(self) -> Table:
        """localization.csv: metres, radians; stamp in seconds as text with nine decimals."""
        rows = [
            _row(stamp, pose, update)
            for stamp, pose, update in zip(self._stamps, self._poses, self._updates, strict=True)
        ]
        return Table(COLUMNS, rows)

    def series(self) -> Mapping[str, Series]:
        """Confidence, fit, spread and number of particles over time."""
        stamps = np.array(self._stamps, np.int64)
        updates = self._updates
        values = {
            "confidence": ([u.assessment.confidence for u in updates], ""),
            "fit": ([u.assessment.fit for u in updates], ""),
            "wall_distance": ([u.assessment.distance_m for u in updates], "m"),
            "particle_spread": ([u.belief.spread_m for u in updates], "m"),
            "particle_spread_all": ([u.spread_m for u in updates], "m"),
            "particles": ([u.particles for u in updates], ""),
        }
        return {name: Series(stamps, np.array(v, np.float64), unit) for name, (v, unit) in values.items()}

    def measures(self) -> Mapping[str, object]:
        """Shares of the scans in each state, and when the filter was first sure."""
        statuses = [u.assessment.status for u in self._updates]
        n = max(len(statuses), 1)
        first = statuses.index("localized") if "localized" in statuses else None
        seconds = None if first is None else (self._stamps[first] - self._stamps[0]) * 1e-9
        return {
            "localization": {
                **{f"share_{name}": statuses.count(name) / n for name in ("localized", "uncertain", "lost")},
                "localized_after_s": seconds,
                "status_at_end": statuses[-1] if statuses else "lost",
            }
        }


def _row(stamp_ns: int, pose: np.ndarray, update: Update) -> tuple[object, ...]:
    covariance = _variances(update.belief)
    assessment = update.assessment
    return (
        format_stamp(stamp_ns),
        *(float(v) for v in pose),
        *covariance,
        assessment.confidence,
        assessment.fit,
        update.belief.spread_m,
        update.spread_m,
        update.particles,
        assessment.status,
    )


def _variances(belief: Belief) -> tuple[float, float, float]:
    x, y, yaw = np.diag(belief.covariance)
    return float(x), float(y), float(yaw)
