"""Times between scans in which nothing measured the robot's motion, and after which it is not known where the robot is."""

from __future__ import annotations

from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.motion.scan_poses import MAX_SCAN_GAP_S

MIN_INLIER_RATIO = 0.4  # a match with fewer inliers has not found the place again
MAX_TRAVEL_M = 1.0  # largest distance at the speed before a gap: places farther away may look alike


class UnmeasuredGaps:
    """Remembers the longest gap without scans and odometry after which a scan may have matched another place."""

    def __init__(self) -> None:
        self._longest_s = 0.0

    def add(self, elapsed_s: float, speed_mps: float, match: ScanMatch) -> None:
        """Add the match of a scan without odometry, `elapsed_s` after the one before, up to which the robot had a speed."""
        is_found = match.is_matched and match.inlier_ratio >= MIN_INLIER_RATIO
        if elapsed_s > MAX_SCAN_GAP_S and not (is_found and speed_mps * elapsed_s < MAX_TRAVEL_M):
            self._longest_s = max(self._longest_s, elapsed_s)

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the path after such a gap; None without one."""
        if not self._longest_s:
            return None
        return (
            f"nothing shows how the robot moved in {self._longest_s:.1f} s without a scan, so the path may be wrong from there "
            "on; record odometry, or map the parts as two logs"
        )
