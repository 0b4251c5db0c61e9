"""Schedule of the searches of the map, and the trust in the tracked pose at each of them.

A pose is trusted while the last comparison confirmed it. Only then does travel count in its favour at the next comparison: a
wrong pose in a place that looks alike agrees with the map too.
"""

from __future__ import annotations

RETRY_M = 1.0  # travel between searches while the robot is lost or uncertain, or is not confirmed any more
CHECK_M = 4.0  # travel after which the window is full, and a pose can be confirmed: until then it is compared ever later
RECHECK_M = 25.0  # travel to the next comparison while the robot is localized; each that confirms the pose doubles it ...
MAX_RECHECK_M = 100.0  # ... up to this
WORSE_RATIO = 0.1  # a drop of the inlier ratio below its mean from which a confirmed pose is compared after CHECK_M already
MEAN_TRAVEL_M = 5.0  # travel over which the inlier ratio is averaged

START_LOG_ODDS = 3.0  # log-odds in favour of a start pose
LOG_ODDS_PER_M = 1.0  # gain of a trusted pose by a metre of travel while it agrees with the map
LOST_LOG_ODDS_PER_M = 3.0  # loss of a lost pose by a metre of travel
# Of a pose that is not trusted any more, above which it is compared again soon: they halve each time
DOUBTED_LOG_ODDS = 1.0
MAX_LOG_ODDS = 10.0  # largest log-odds of a pose before a comparison


class SearchSchedule:
    """Travel since the last search of the map, whether that confirmed the tracked pose, and the prior log-odds of the pose.

    `is_trusted`: the pose is the start pose that the user gave, or was confirmed by the last comparison. `is_best`: it led all
    other places in that comparison, although it may not have been confirmed.
    """

    def __init__(self, has_start: bool) -> None:
        self._since_search_m = (
            RETRY_M  # a start pose that does not agree with the map at all is compared at once
        )
        self._travel_m = 0.0  # since the start, or since all trust was withdrawn
        self._is_confirmed = False  # by a window that was full
        self._recheck_m = RECHECK_M
        self._mean_inlier_ratio = 0.0
        self._matches_worse = False  # with the map than over the last metres
        self.is_trusted = has_start
        self.is_best = False
        self.prior_log_odds = START_LOG_ODDS if has_start else 0.0

    def travel(self, distance_m: float) -> None:
        """Add travel since the last search."""
        self._since_search_m += distance_m
        self._travel_m += distance_m

    def assessed(self, status: str, inlier_ratio: float, travel_m: float) -> None:
        """Update the prior log-odds: a trusted pose that agrees with the map while the robot moves gains, a lost one loses.

        `status` is that of the particles alone.
        """
        if status != "localized" and self._is_confirmed:  # compared again by scans of its own, soon and often
            self._is_confirmed = False
            self._travel_m = self._since_search_m = 0.0
        rate = LOG_ODDS_PER_M if status == "localized" and self.is_trusted else 0.0
        if status == "lost":
            rate = -LOST_LOG_ODDS_PER_M
        self.prior_log_odds = min(max(self.prior_log_odds + rate * travel_m, 0.0), MAX_LOG_ODDS)
        self._matches_worse = inlier_ratio < self._mean_inlier_ratio - WORSE_RATIO
        self._mean_inlier_ratio += min(travel_m / MEAN_TRAVEL_M, 1.0) * (
            inlier_ratio - self._mean_inlier_ratio
        )

    def is_due(self, status: str) -> bool:
        """Whether the map is to be searched now, given the status of the particles alone."""
        if status != "localized":
            return self._since_search_m >= RETRY_M
        if self._is_confirmed:
            return self._since_search_m >= (CHECK_M if self._matches_worse else self._recheck_m)
        if self.prior_log_odds > DOUBTED_LOG_ODDS and not self.is_trusted:
            return self._since_search_m >= RETRY_M
        return self._since_search_m >= min(max(0.5 * self._travel_m, RETRY_M), CHECK_M)

    def searched(self) -> None:
        """Restart the travel after a search."""
        self._since_search_m = 0.0

    def confirm(self, is_confirmed: bool, is_best: bool) -> None:
        """Store the result of the last comparison for the tracked pose; unless confirmed, it loses half of its prior log-odds."""
        self.is_trusted, self.is_best = is_confirmed, is_best
        if not is_confirmed:
            self.prior_log_odds *= 0.5
        was_confirmed, self._is_confirmed = self._is_confirmed, is_confirmed and self._travel_m >= CHECK_M
        again_m = min(2.0 * self._recheck_m, MAX_RECHECK_M)
        self._recheck_m = again_m if was_confirmed and self._is_confirmed else RECHECK_M

    def doubt(self) -> None:
        """Withdraw all trust, as after a jump of the odometry, or when a scan does not continue the one before it."""
        self.switched()
        self._since_search_m = 0.0

    def switched(self) -> None:
        """Withdraw all trust, as other particles have taken over."""
        self.is_trusted = self.is_best = self._is_confirmed = False
        self._travel_m = 0.0
        self.prior_log_odds = 0.0
