"""Finds what a lidar sees of its own robot: returns that keep their bearing and range while all others change."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event, LaserScan, Odometry, readonly

Floats = NDArray[np.float64]

MAX_BODY_M = 1.2  # a robot's mast, handle or wheel is not farther from its lidar
TOLERANCE_M = 0.03  # noise of near returns
# Fraction of the views that show a body: people and doors are in view for a part of them
MIN_CONSTANT_FRACTION = 0.9
# Two views differ where more than `MIN_CHANGED_FRACTION` of the ranges differ by more than `CHANGED_M`.
CHANGED_M, MIN_CHANGED_FRACTION = 0.1, 0.5
MIN_VIEWS, MAX_VIEWS = 15, 60  # numbers of views that differ
# New views after which a body that comes later is looked for again: at each it would take a tenth of a run.
CHECKED_VIEWS = 5
# Rotation of the robot over the views: beside a straight drive a wall looks like a body
MIN_ROTATION_RAD = 4.0
# Largest fraction of beams on a body: a lidar that sees more near it stands in a narrow place
MAX_BODY_FRACTION = 0.5
EDGE_BEAMS, EDGE_M = 2, 0.15  # readings beside a body that mix it with what is behind


class BeamLayout(NamedTuple):
    """The beams of a lidar: its frame, their number, first bearing and step (rad); those of a whole circle begin at -pi."""

    frame_id: str
    number: int
    first_rad: float
    step_rad: float


@dataclass(frozen=True, slots=True)
class OwnBody:
    """Farthest range (m) `(n,)` of the robot's body by beam of one lidar; 0 where a beam does not meet it."""

    beams: BeamLayout
    limits_m: Floats

    def removed_from(self, scan: LaserScan) -> LaserScan:
        """The scan with NaN for readings of the body; a scan with other beams unchanged."""
        beams, order = beams_of(scan)
        if beams != self.beams:
            return scan
        is_body = scan.ranges_m <= self.limits_m[order]
        if not is_body.any():
            return scan
        return replace(scan, ranges_m=readonly(np.where(is_body, np.nan, scan.ranges_m), np.float32))

    @property
    def sectors(self) -> list[tuple[float, float, float]]:
        """First and last bearing (deg) and range (m) of each part of the body, in the lidar's frame."""
        hit = np.flatnonzero(self.limits_m)
        parts = np.split(hit, np.flatnonzero(np.diff(hit) > 1) + 1)
        degrees = np.degrees(self.beams.first_rad + self.beams.step_rad * np.arange(self.beams.number))
        return [
            (float(degrees[p[0]]), float(degrees[p[-1]]), float(self.limits_m[p].max() - EDGE_M))
            for p in parts
        ]

    @property
    def note(self) -> str:
        """One line for the user."""
        parts = [f"{first:.0f} to {last:.0f} deg ({range_m:.2f} m)" for first, last, range_m in self.sectors]
        return f"{self.beams.frame_id} sees the robot itself at bearings {', '.join(parts)}; these returns are left out"


def find_own_bodies(scans: Iterable[LaserScan]) -> list[OwnBody]:
    """The body of the robot in the view of each lidar, given scans of a robot that drives and turns; those that see none are
    left out.
    """
    limits = {beams: _body_limits(views) for beams, views in different_views_of(scans).items()}
    return [OwnBody(beams, limits_m) for beams, limits_m in limits.items() if limits_m.any()]


def different_views_of(scans: Iterable[LaserScan]) -> dict[BeamLayout, Floats]:
    """Ranges (m) `(views, n)` by beam of the scans of each lidar that differ from the last one chosen; 0: no return."""
    by_beams: dict[BeamLayout, list[NDArray[np.float32]]] = defaultdict(list)
    for scan in scans:
        if not len(scan.ranges_m):
            continue
        beams, order = beams_of(scan)
        sorted_ranges = np.empty_like(scan.ranges_m)
        sorted_ranges[order] = scan.ranges_m
        by_beams[beams].append(sorted_ranges)
    taken = {beams: np.array(ranges, np.float64) for beams, ranges in by_beams.items()}
    return {
        beams: _different_views(np.where(np.isfinite(ranges), ranges, 0.0)) for beams, ranges in taken.items()
    }


class LaterBodies:
    """Finds parts of the body that a lidar sees from some time on: a load, an arm, another lidar that was put on."""

    def __init__(self) -> None:
        self._views: dict[BeamLayout, list[tuple[float, NDArray[np.float32]]]] = defaultdict(list)
        self._unchecked: Counter[BeamLayout] = Counter()

    def found_in(self, scan: LaserScan, turned_rad: float) -> OwnBody | None:
        """The body that this scan and the different ones before it show, or None.

        `turned_rad` is how far the robot has turned so far, back and forth: it shows no body until it has turned.
        """
        if not len(scan.ranges_m):
            return None
        beams, order = beams_of(scan)
        ranges = np.empty_like(scan.ranges_m)
        ranges[order] = np.where(np.isfinite(scan.ranges_m), scan.ranges_m, 0.0)
        views = self._views[beams]
        if views and not _differ(ranges, views[-1][1]):
            return None
        views.append((turned_rad, ranges))
        del views[:-MAX_VIEWS]
        self._unchecked[beams] += 1
        if self._unchecked[beams] < CHECKED_VIEWS:
            return None
        self._unchecked[beams] = 0
        turning = [view for turned, view in views if turned >= turned_rad - MIN_ROTATION_RAD]
        if len(turning) == len(views):  # the robot has not turned so far yet
            return None
        limits_m = _body_limits(np.array(_views_of_rotation(views, turning), np.float64))
        if not limits_m.any():
            return None
        views.clear()
        return OwnBody(beams, limits_m)


def _views_of_rotation(
    views: Sequence[tuple[float, NDArray[np.float32]]], turning: Sequence[NDArray[np.float32]]
) -> list[NDArray[np.float32]]:
    """The views of the last MIN_ROTATION_RAD, and as many before them as make MIN_VIEWS."""
    return [view for _, view in views[-max(len(turning), MIN_VIEWS) :]]


def beams_of(scan: LaserScan) -> tuple[BeamLayout, NDArray[np.int64]]:
    """The beams of a scan, and the index `(n,)` of each of its readings among them."""
    frame, count = scan.frame_id.partition("@")[0], len(scan.ranges_m)
    return _layout(frame, count, scan.angle_min_rad, scan.angle_increment_rad)


@lru_cache(maxsize=64)  # most scans of a log have the same beams
def _layout(frame: str, count: int, first_rad: float, step: float) -> tuple[BeamLayout, NDArray[np.int64]]:
    """The beams, and the index of each reading among them: a scan of the whole circle may begin at any bearing."""
    places = np.arange(count)
    if abs(abs(step) * count - 2.0 * np.pi) < 0.5 * abs(step):
        circle_step = 2.0 * np.pi / count
        first = round((first_rad + np.pi) / circle_step - 0.5)
        return BeamLayout(frame, count, 0.5 * circle_step - np.pi, circle_step), (
            first + (places if step > 0.0 else -places)
        ) % count
    return BeamLayout(frame, count, first_rad, step), places


def _body_limits(views: Floats) -> Floats:
    """Farthest range of the body `(n,)` by beam, 0 without a body, given ranges `(views, n)` of views that differ."""
    none = np.zeros(views.shape[1])
    if len(views) < MIN_VIEWS:
        return none
    middle = np.median(views, axis=0)
    is_constant = (np.abs(views - middle) < TOLERANCE_M).mean(axis=0) >= MIN_CONSTANT_FRACTION
    is_body = is_constant & (middle > 0.0) & (middle < MAX_BODY_M)
    if not 0.0 < is_body.mean() < MAX_BODY_FRACTION:
        return none
    limits = np.where(is_body, middle + EDGE_M, 0.0)
    padded = np.pad(limits, EDGE_BEAMS)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * EDGE_BEAMS + 1).max(axis=1))


def _different_views(ranges: Floats) -> Floats:
    """The scans among `(scans, n)` in which most ranges have changed since the last one chosen; 0: no return."""
    chosen = [0]
    for i in range(1, len(ranges)):
        if _differ(ranges[i], ranges[chosen[-1]]):
            chosen.append(i)
    return ranges[chosen]


def _differ(ranges: NDArray[np.floating[Any]], others: NDArray[np.floating[Any]]) -> bool:
    """Whether most ranges `(n,)` of two scans differ; 0: no return."""
    changed = np.count_nonzero(np.abs(ranges - others) > CHANGED_M)
    return int(changed) > MIN_CHANGED_FRACTION * len(ranges)


def later_bodies_among(events: Sequence[Event], known: Sequence[OwnBody]) -> list[OwnBody]:
    """Parts of the robot that its lidars see during a part of the events only, besides the known ones."""
    later, turned_rad = LaterBodies(), 0.0
    last_rad: float | None = None
    found: list[OwnBody] = []
    for event in events:
        if isinstance(event, Odometry) and math.isfinite(event.yaw_rad):
            turned_rad += abs(
                math.remainder(event.yaw_rad - (event.yaw_rad if last_rad is None else last_rad), 2 * math.pi)
            )
            last_rad = event.yaw_rad
        elif isinstance(event, LaserScan):
            for body in (*known, *found):
                event = body.removed_from(event)
            if (new := later.found_in(event, turned_rad)) is not None:
                found.append(new)
    return found
