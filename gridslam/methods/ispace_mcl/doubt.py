"""When a finished localization is not to be trusted, and what to tell the user then."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Doubt

# A localization is trusted if it was localized for most of the log, or, after a late start, for nearly all of the log's end.
MIN_LOCALIZED_RATIO = 0.5
END_RATIO = 0.25  # length of the end, as a ratio of the scans
MIN_LOCALIZED_AT_END = 0.9
MAX_WALL_RATIO = 0.5  # walls cover a few percent of a building; above this ratio of the known cells the map is probably negated


# Mean ratio of displaced beams over the localized scans. On right maps up to 0.016 (crowds and recorded places included), on
# mirrored maps of nearly symmetric places often 0.04 and more (tests/benchmarks/bench_wrong_maps.py).
MAX_DISPLACED_RATIO = 0.03
MIN_LOCALIZED_SCANS = 10  # from which that mean says something


def doubt_of(
    statuses: Sequence[str],
    displaced_ratios: Sequence[float],
    occupancy: OccupancyGrid,
    occupied_threshold: float,
) -> Doubt | None:
    """The doubt about a localization with these statuses (localized, uncertain, lost) of its scans; None if it is trusted.

    `displaced_ratios` are those of the scans' assessments.
    """
    if not statuses:
        return None
    localized = np.array([status == "localized" for status in statuses])
    end = localized[-max(int(END_RATIO * len(localized)), 1) :]
    is_found = localized.mean() >= MIN_LOCALIZED_RATIO or end.mean() >= MIN_LOCALIZED_AT_END
    if is_found and statuses[-1] != "lost":
        return _doubt_of_walls(np.asarray(displaced_ratios, np.float64)[localized])
    return Doubt(
        "lost",
        f"localized {100.0 * localized.mean():.0f} % of the time, {statuses[-1]} at the end; "
        f"{_question(occupancy, occupied_threshold)}",
    )


def _doubt_of_walls(displaced: NDArray[np.float64]) -> Doubt | None:
    """The doubt about a map whose walls are nearly where the robot sees them: a mirror image, or another floor."""
    if len(displaced) < MIN_LOCALIZED_SCANS or displaced.mean() <= MAX_DISPLACED_RATIO:
        return None
    return Doubt(
        "inconsistent",
        f"localized, but {100.0 * displaced.mean():.0f} % of the beams at walls end behind them; "
        "is the map mirrored, of another floor, or out of date?",
    )


def _question(occupancy: OccupancyGrid, occupied_threshold: float) -> str:
    """What the user should check."""
    known = ~np.isnan(occupancy.probability)
    walls = float((occupancy.probability[known] >= occupied_threshold).mean()) if known.any() else 0.0
    if walls > MAX_WALL_RATIO:
        return f"walls cover {100.0 * walls:.0f} % of the map: is its `negate` wrong?"
    return "does this map belong to this place, and are its resolution and origin right?"
