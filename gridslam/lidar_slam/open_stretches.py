"""Parts of the path along which the scans do not show how far the robot moved: smooth corridors, round ones, a single wall.

Odometry alone gives the distance there, and another passage does not check it, since it slides along the same walls.
"""

from __future__ import annotations

from dataclasses import dataclass

from gridslam.lidar_slam.front_end import ScanMatch

# Travel with certain matches, at least and relative to that without, that ends a stretch: people who pass by make some matches
# seem certain, and of two lidars one may see more
MIN_CERTAIN_M, MIN_CERTAIN_RATIO = 1.0, 0.3
# Expected error relative to the distance: of odometry (loops are sought within five times that, see `odometry_noise`), and of
# matching without any, because the robot may not have kept its speed
ODOMETRY_ERROR, SLIDING_ERROR = 0.02, 0.1
SPEED_S = 1.0  # time over which the speed is averaged
MIN_SPEED_MPS = 0.15  # assumed for a robot that seems to stand, where neither odometry nor scans show it
MAX_ERROR_M = 1.2  # a path with a larger expected error is doubted


def shows_distance(match: ScanMatch) -> bool:
    """Whether a match shows how far the robot moved."""
    return match.is_matched and not match.is_open


@dataclass(frozen=True, slots=True)
class OpenStretch:
    """A part of the path: its length (m) and the error of the length (m) that is to be expected."""

    length_m: float = 0.0
    error_m: float = 0.0


class OpenStretches:
    """Remembers the stretch whose length is least certain."""

    def __init__(self) -> None:
        self.worst = OpenStretch()
        self._present = OpenStretch()
        self._certain_m = 0.0  # travel with certain matches within it
        self._speed_mps = 0.0  # by the last certain matches

    def add(self, travel_m: float, elapsed_s: float, match: ScanMatch, has_odometry: bool) -> None:
        """Add the travel to a scan and its duration, its match, and whether there was odometry.

        Without odometry matching may slide on the spot: the robot is assumed to have kept its speed, or to creep.
        """
        if not shows_distance(match):
            if not has_odometry:
                travel_m = max(travel_m, max(self._speed_mps, MIN_SPEED_MPS) * elapsed_s)
            error_m = (ODOMETRY_ERROR if has_odometry else SLIDING_ERROR) * travel_m
            present = self._present
            self._present = OpenStretch(present.length_m + travel_m, present.error_m + error_m)
            self.worst = max(self.worst, self._present, key=lambda stretch: stretch.error_m)
            return
        weight = min(elapsed_s / SPEED_S, 1.0)
        self._speed_mps += weight * (travel_m / max(elapsed_s, 1e-3) - self._speed_mps)
        self._certain_m += travel_m
        if self._certain_m > max(MIN_CERTAIN_M, MIN_CERTAIN_RATIO * self._present.length_m):
            self._present, self._certain_m = OpenStretch(), 0.0

    @property
    def measures(self) -> dict[str, float]:
        """The stretch whose length is least certain, for the report."""
        return {"length_m": round(self.worst.length_m, 1), "expected_error_m": round(self.worst.error_m, 2)}

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the length of a stretch; None without one."""
        length_m, error_m = self.worst.length_m, self.worst.error_m
        if error_m <= MAX_ERROR_M:
            return None
        return (
            f"on {length_m:.0f} m in one piece the scans do not show how far the robot moved (walls without features, or out of "
            f"range): the map may be wrong by {error_m:.0f} m there"
        )
