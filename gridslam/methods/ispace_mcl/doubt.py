"""Doubt about a finished localization, with advice to the user."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Doubt

# A localization is trusted if it was localized for most of the log, or, after a late start, for nearly all of the log's end.
MIN_LOCALIZED_RATIO = 0.5
END_RATIO = 0.25  # length of the end, as a ratio of the scans
MIN_LOCALIZED_AT_END = 0.9
# By then most scans by which the pose was compared are others than those by which it was found: the window is 4 m long
MIN_LOCALIZED_M = 5.0
MAX_WALL_RATIO = 0.5  # walls cover a few percent of a building; above this ratio of the known cells the map is probably negated


# Mean ratio of displaced beams over the localized scans. On right maps up to 0.016 (crowds and recorded places included), on
# mirrored maps of nearly symmetric places often 0.04 and more (tests/benchmarks/bench_wrong_maps.py).
MAX_DISPLACED_RATIO = 0.03
ALIKE = (
    "the scans agree with the map, but in more than one place that looks alike (as along a corridor): "
    "--start would decide between them"
)
MIRRORED = "localized, but the mirror image of the scans fits the map better: is the map mirrored, or the lidar upside down?"
MIN_LOCALIZED_SCANS = 10  # number of localized scans from which a mean over them is meaningful
# Median inlier ratio of the scans that were not localized, from which the map fits and only the place is undecided: 1.0 in a
# corridor that looks alike all along, about 0.7 on a map of another place.
FITTING_RATIO = 0.9
# Ratio of these scans whose beams end beside or behind the walls, from which the map does not fit although they end near them
MAX_CONTRADICTED = 0.5
# Between places where the robot was localized: one when it is carried, or found after a first error
MAX_JUMPS = 1


class History(Protocol):
    """Of each scan: its status (localized, uncertain, lost), and its ratios of inliers and of displaced beams."""

    @property
    def statuses(self) -> Sequence[str]:
        """Status of every scan: localized, uncertain or lost."""

    @property
    def inlier_ratios(self) -> Sequence[float]:
        """Fraction of the beams of every scan that agree with the map."""

    @property
    def contradicted(self) -> Sequence[bool]:
        """Whether more beams end beside or behind walls, at every scan, than on a right map."""

    @property
    def displaced_ratios(self) -> Sequence[float]:
        """Fraction of the beams of every scan that end behind their wall."""

    def localized_m(self) -> float:
        """Travel (m) by odometry while localized."""

    def travel_ratio(self) -> float:
        """Travel on the map over travel by odometry; 1 without clear evidence of a difference."""

    def jumps_m(self) -> NDArray[np.float64]:
        """Distances `(k,)` (m) between successive places of a localized robot that the odometry does not connect."""


def doubt_of(
    history: History, occupancy: OccupancyGrid, occupied_threshold: float, is_map_mirrored: bool = False
) -> Doubt | None:
    """The doubt about a localization; None if it is trusted."""
    statuses = history.statuses
    if not statuses:
        return None
    localized = np.array([status == "localized" for status in statuses])
    end = localized[-max(int(END_RATIO * len(localized)), 1) :]
    is_held = end.mean() >= MIN_LOCALIZED_AT_END and history.localized_m() >= MIN_LOCALIZED_M
    is_found = localized.mean() >= MIN_LOCALIZED_RATIO or is_held
    if is_found and statuses[-1] != "lost":
        if is_map_mirrored:
            return Doubt("inconsistent", MIRRORED)
        displaced = np.asarray(history.displaced_ratios, np.float64)[localized]
        return (
            _doubt_of_walls(displaced)
            or _doubt_of_scale(history.travel_ratio())
            or _doubt_of_jumps(history.jumps_m())
        )
    inliers = np.asarray(history.inlier_ratios, np.float64)[~localized]
    contradicted = np.asarray(history.contradicted, np.bool_)[~localized]
    is_fitting = (
        len(inliers) > 0
        and float(np.median(inliers)) >= FITTING_RATIO
        and contradicted.mean() < MAX_CONTRADICTED
    )
    cause = ALIKE if is_fitting else _question(occupancy, occupied_threshold)
    return Doubt(
        "lost",
        f"localized {100.0 * localized.mean():.0f} % of the time, {statuses[-1]} at the end; {cause}",
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


def _doubt_of_scale(travel_ratio: float) -> Doubt | None:
    """The doubt about odometry or a map of another scale than the place."""
    if travel_ratio == 1.0:
        return None
    return Doubt(
        "inconsistent",
        f"localized, but the robot drove {travel_ratio:.2f} times as far on the map as by its odometry; "
        "is the odometry's scale right, and the map's resolution?",
    )


def _doubt_of_jumps(jumps_m: NDArray[np.float64]) -> Doubt | None:
    """The doubt about places that contradict each other: at most one of them is right, unless the robot was carried."""
    if len(jumps_m) <= MAX_JUMPS:
        return None
    return Doubt(
        "inconsistent",
        f"localized in {len(jumps_m) + 1} places that the odometry does not connect ({jumps_m.max():.0f} m between two of them): "
        "does this map belong to this place, or was the robot carried?",
    )


def _question(occupancy: OccupancyGrid, occupied_threshold: float) -> str:
    """A question to the user about the likely cause."""
    known = int(np.count_nonzero(~np.isnan(occupancy.probability)))
    walls = int(np.count_nonzero(occupancy.probability >= occupied_threshold)) / max(known, 1)
    if walls > MAX_WALL_RATIO:
        return f"walls cover {100.0 * walls:.0f} % of the map: is its `negate` wrong?"
    return "does this map belong to this place, and are its resolution and origin right?"
