"""Gaps between scans in which no sensor measured the motion, so that the robot's position afterwards is uncertain."""

from __future__ import annotations

from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.motion.scan_poses import MAX_SCAN_GAP_S

MIN_INLIER_RATIO = 0.4  # inlier ratio below which a match after a gap may be at a wrong place
MAX_TRAVEL_M = 1.0  # largest travel in a gap, at the speed before it; places farther away may look alike


class UnmeasuredGaps:
    """The longest gap without scans and odometry after which a scan may have been matched to a wrong place."""

    def __init__(self) -> None:
        self._longest_s = 0.0

    def add(self, elapsed_s: float, speed_mps: float, match: ScanMatch) -> None:
        """Add the match of a scan without odometry, `elapsed_s` after the previous scan, when the robot drove at `speed_mps`."""
        is_found = match.is_matched and match.inlier_ratio >= MIN_INLIER_RATIO
        if elapsed_s > MAX_SCAN_GAP_S and not (is_found and speed_mps * elapsed_s < MAX_TRAVEL_M):
            self._longest_s = max(self._longest_s, elapsed_s)

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the path after the longest gap; None if there is no gap."""
        if not self._longest_s:
            return None
        return (
            f"nothing shows how the robot moved in {self._longest_s:.1f} s without a scan, so the path may be wrong from there "
            "on; record odometry, or map the parts as two logs"
        )
