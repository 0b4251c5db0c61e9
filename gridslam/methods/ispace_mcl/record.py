"""The history of a localization, and its table, series and measures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory, stretches
from gridslam.filters.particles import Belief
from gridslam.methods.base import Series, Table
from gridslam.methods.ispace_mcl.confidence import FilterUpdate
from gridslam.methods.ispace_mcl.travel_ratio import jumps_m, travel_ratio

COLUMNS = (
    "stamp",
    "x",
    "y",
    "yaw",
    "var_x",
    "var_y",
    "var_yaw",
    "confidence",
    "inlier_ratio",
    "std",
    "std_all",
    "n_particles",
    "status",
)


class LocalizationHistory:
    """A row for every scan; scans between updates have the assessment of the last update."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[np.ndarray] = []
        self._odometry: list[np.ndarray] = []
        self._updates: list[FilterUpdate] = []

    def add(self, stamp_ns: int, pose: np.ndarray, odometry: np.ndarray, update: FilterUpdate) -> None:
        """Add the pose `(3,)` and T_odom_base `(3,)` at a scan's stamp, and the last update until then."""
        self._stamps.append(stamp_ns)
        self._odometry.append(odometry)
        self._poses.append(pose)
        self._updates.append(update)

    def trajectory(self) -> Trajectory:
        """The poses of all scans in the order of their stamps."""
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
        """Confidence, inlier ratio, standard deviations and number of particles over time."""
        stamps = np.array(self._stamps, np.int64)
        updates = self._updates
        values = {
            "confidence": ([u.assessment.confidence for u in updates], ""),
            "inlier_ratio": ([u.assessment.inlier_ratio for u in updates], ""),
            "wall_distance": ([u.assessment.distance_m for u in updates], "m"),
            "particle_std": ([u.belief.std_m for u in updates], "m"),
            "particle_std_all": ([u.std_m for u in updates], "m"),
            "particles": ([u.particles for u in updates], ""),
        }
        return {name: Series(stamps, np.array(v, np.float64), unit) for name, (v, unit) in values.items()}

    @property
    def statuses(self) -> list[str]:
        """The status (localized, uncertain or lost) of each scan."""
        return [update.assessment.status for update in self._updates]

    @property
    def inlier_ratios(self) -> list[float]:
        """The running mean of the ratio of beams that agree with the map, at each scan."""
        return [update.assessment.inlier_ratio for update in self._updates]

    @property
    def contradicted(self) -> list[bool]:
        """Whether at each scan more of the last beams ended beside or behind walls than on a right map."""
        return [update.assessment.is_contradicted for update in self._updates]

    @property
    def displaced_ratios(self) -> list[float]:
        """The ratio of displaced beams at each scan."""
        return [update.assessment.displaced_ratio for update in self._updates]

    def travel_ratio(self) -> float:
        """Travel on the map over travel by odometry; 1 without clear evidence of a difference."""
        if len(self._poses) < 2:
            return 1.0
        return travel_ratio(np.array(self._poses), np.array(self._odometry), ~self.is_untrusted())

    def localized_m(self) -> float:
        """Travel (m) by odometry while localized."""
        if len(self._odometry) < 2:
            return 0.0
        steps = np.hypot(*np.diff(np.array(self._odometry)[:, :2], axis=0).T)
        is_localized = ~self.is_untrusted()
        return float(steps[is_localized[1:] & is_localized[:-1]].sum())

    def jumps_m(self) -> NDArray[np.float64]:
        """Lengths `(k,)` (m) of the jumps of localized poses from the pose before, moved by the odometry."""
        if len(self._poses) < 2:
            return np.zeros(0)
        return jumps_m(np.array(self._poses), np.array(self._odometry), ~self.is_untrusted())

    def untrusted_ns(self) -> NDArray[np.int64]:
        """First and last stamps `(k, 2)` of the parts in which the robot was not localized."""
        return stretches(np.array(self._stamps, np.int64), self.is_untrusted())

    def is_untrusted(self) -> NDArray[np.bool_]:
        """Whether the robot was not localized `(n,)` at each scan."""
        return np.array([status != "localized" for status in self.statuses], np.bool_)

    def measures(self) -> Mapping[str, object]:
        """Fractions of the scans with each status, the seconds until the first localized one, and the last status."""
        statuses = self.statuses
        n = max(len(statuses), 1)
        first = statuses.index("localized") if "localized" in statuses else None
        seconds = None if first is None else (self._stamps[first] - self._stamps[0]) * 1e-9
        return {
            "localization": {
                **{
                    f"{name}_fraction": statuses.count(name) / n
                    for name in ("localized", "uncertain", "lost")
                },
                "localized_after_s": seconds,
                "status_at_end": statuses[-1] if statuses else "lost",
                "travel_over_odometry": round(self.travel_ratio(), 3),
                "jumps": len(self.jumps_m()),
            }
        }


def _row(stamp_ns: int, pose: np.ndarray, update: FilterUpdate) -> tuple[object, ...]:
    variances = _variances(update.belief)
    assessment = update.assessment
    return (
        format_stamp(stamp_ns),
        *(float(v) for v in pose),
        *variances,
        assessment.confidence,
        assessment.inlier_ratio,
        update.belief.std_m,
        update.std_m,
        update.particles,
        assessment.status,
    )


def _variances(belief: Belief) -> tuple[float, float, float]:
    x, y, yaw = np.diag(belief.covariance)
    return float(x), float(y), float(yaw)
