"""When a finished localization is not to be trusted, and what to tell the user then."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Doubt

# A localization is trusted if it was localized for most of the log, or, after a late start, for nearly all of the log's end.
MIN_LOCALIZED_RATIO = 0.5
END_RATIO = 0.25  # length of the end, as a ratio of the scans
MIN_LOCALIZED_AT_END = 0.9
MAX_WALL_RATIO = 0.5  # walls cover a few percent of a building; above this ratio of the known cells the map is probably negated


def doubt_of(statuses: Sequence[str], occupancy: OccupancyGrid, occupied_threshold: float) -> Doubt | None:
    """The doubt about a localization with these statuses (localized, uncertain, lost) of its scans; None if it is trusted."""
    if not statuses:
        return None
    localized = np.array([status == "localized" for status in statuses])
    end = localized[-max(int(END_RATIO * len(localized)), 1) :]
    is_found = localized.mean() >= MIN_LOCALIZED_RATIO or end.mean() >= MIN_LOCALIZED_AT_END
    if is_found and statuses[-1] != "lost":
        return None
    return Doubt(
        "lost",
        f"localized {100.0 * localized.mean():.0f} % of the time, {statuses[-1]} at the end; "
        f"{_question(occupancy, occupied_threshold)}",
    )


def _question(occupancy: OccupancyGrid, occupied_threshold: float) -> str:
    """What the user should check."""
    known = ~np.isnan(occupancy.probability)
    walls = float((occupancy.probability[known] >= occupied_threshold).mean()) if known.any() else 0.0
    if walls > MAX_WALL_RATIO:
        return f"walls cover {100.0 * walls:.0f} % of the map: is its `negate` wrong?"
    return "does this map belong to this place, and are its resolution and origin right?"
