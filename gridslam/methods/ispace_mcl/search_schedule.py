"""When the map is searched, and how much a tracked pose is trusted by then."""

from __future__ import annotations

RETRY_M = 1.0  # travel between searches while the robot is lost or uncertain
CHECK_M = 4.0  # travel after which the window is full, and a pose can be confirmed: until then it is compared ever later
RECHECK_M = 25.0  # travel between comparisons while the robot is localized

START_LOG_ODDS = 3.0  # in favour of a start pose
LOG_ODDS_PER_M = 1.0  # that the tracked pose gains by a metre of travel while localized
LOST_LOG_ODDS_PER_M = 3.0  # that it loses by a metre of travel while lost
MAX_LOG_ODDS = 6.0  # that it can have before a comparison


class SearchSchedule:
    """Travel since the last search of the map, whether that confirmed the tracked pose, and the prior log-odds of the pose."""

    def __init__(self, has_start: bool) -> None:
        self._since_search_m = (
            RETRY_M  # a start pose that does not agree with the map at all is compared at once
        )
        self._travel_m = 0.0  # since the start, or since all trust was withdrawn
        self._is_confirmed = False
        self.prior_log_odds = START_LOG_ODDS if has_start else 0.0

    def travel(self, distance_m: float) -> None:
        """Add travel since the last search."""
        self._since_search_m += distance_m
        self._travel_m += distance_m

    def assessed(self, status: str, travel_m: float) -> None:
        """Update the prior log-odds: a pose that agrees with the map while the robot moves gains, a lost one loses."""
        rate = LOG_ODDS_PER_M if status == "localized" else 0.0
        if status == "lost":
            rate = -LOST_LOG_ODDS_PER_M
        self.prior_log_odds = min(max(self.prior_log_odds + rate * travel_m, 0.0), MAX_LOG_ODDS)

    def is_due(self, status: str) -> bool:
        """Whether the map is to be searched now."""
        if status != "localized":
            return self._since_search_m >= RETRY_M
        if self._is_confirmed:
            return self._since_search_m >= RECHECK_M
        return self._since_search_m >= min(max(0.5 * self._travel_m, RETRY_M), CHECK_M)

    def searched(self) -> None:
        """Restart the travel after a search."""
        self._since_search_m = 0.0

    def confirm(self, is_confirmed: bool) -> None:
        """Store whether the last comparison confirmed the tracked pose, by a window that was full."""
        self._is_confirmed = is_confirmed and self._travel_m >= CHECK_M

    def reset(self) -> None:
        """Withdraw all trust, as after a jump of the odometry."""
        self._is_confirmed = False
        self._travel_m = 0.0
        self.prior_log_odds = 0.0
