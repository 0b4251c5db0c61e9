"""Mapping and localization with infrared rangers on servos: stop by stop, predict, match, correct, update the map."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event
from gridslam.core.stopwatch import Stopwatch
from gridslam.kernels.start import start
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Estimate, RunResult
from gridslam.methods.ir_scan.adjustment import adjust
from gridslam.methods.ir_scan.config import IrScanConfig, NoMatching, SearchMatching, ShiftMatching
from gridslam.methods.ir_scan.given_map import GivenShiftMap, GivenWallMap
from gridslam.methods.ir_scan.matching import Match, WallMatcher, match_by_shift
from gridslam.methods.ir_scan.pictures import raw_and_filtered
from gridslam.methods.ir_scan.pos_grid import PosGrid
from gridslam.methods.ir_scan.record import measures, series, stops_table, trajectory
from gridslam.methods.ir_scan.scale import scans_of, window_of
from gridslam.methods.ir_scan.stops import Place
from gridslam.methods.ir_scan.surfaces import draw_surfaces
from gridslam.methods.ir_scan.tracker import Tracker
from gridslam.sensors.infrared import BeamEnds, RangeNoise

Floats = NDArray[np.float64]


class Matcher(Protocol):
    """Anything that finds a scan's pose near a predicted one."""

    def match(self, ends: BeamEnds, prior: Floats, covariance: Floats) -> Match:
        """The corrected pose, or the predicted one with the reason why."""


class IrScanMapper:
    """Maps a log; `result` adjusts all stops together and draws the map, where the config says so."""

    def __init__(self, config: IrScanConfig, seed: int) -> None:
        start()
        self._config = config
        self._noise = noise_of(config)
        self._tracker = Tracker(config, np.zeros((3, 3)))
        self._pos = PosGrid(config.resolution_m, config.memory_limit_mb)
        self._delay = config.matching.delay_stops if isinstance(config.matching, ShiftMatching) else 0
        self._waiting: deque[tuple[BeamEnds, Floats]] = (
            deque()
        )  # scans that are not in the map yet, with their poses
        self._walls: WallMatcher | None = None
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The pose at the last stop."""
        return estimate_of(self._tracker)

    def process(self, event: Event) -> None:
        """Readings, wheel angles or odometry, turn rates, fixes and static transforms are used."""
        place = self._tracker.take(event)
        if place is not None:
            self._visit(place)

    def result(self) -> RunResult:
        """The map, the path, the raw grid pos, and the table of stops."""
        if (place := self._tracker.finish()) is not None:
            self._visit(place)
        self._draw_waiting(0)
        config, places = self._config, self._tracker.places
        poses = np.array([place.pose for place in places])
        if config.adjustment.enabled and len(places) > 1:
            with self._stopwatch.stage("adjust"):
                cell_m = config.adjustment.cell_m or window_of(scans_of(places))
                poses = adjust(places, cell_m, config.adjustment.iterations, self._noise)
                self._redraw_pos(poses)
        with self._stopwatch.stage("draw"):
            made = self._pos.occupancy()
            if config.drawing.kind == "surfaces":
                made = draw_surfaces(
                    places, poses, config.drawing, self._noise, config.resolution_m, config.memory_limit_mb
                )
        with self._stopwatch.stage("tell"):
            result = result_of(self._tracker, poses, made, is_smooth=config.adjustment.enabled)
        timings = dict(self._stopwatch.seconds)
        return replace(result, occupancy=made, layers={"pos": self._pos.layer()}, timings_s=timings)

    def _visit(self, place: Place) -> None:
        """Match the scan of a stop, correct its pose, and take the scan into the map."""
        ends = place.ends
        assert ends is not None
        with self._stopwatch.stage("match"):
            match = self._match(ends, place)
        self._tracker.settle(place, match)
        if not len(ends):
            return
        with self._stopwatch.stage("update_map"):
            self._waiting.append((ends, place.pose))
            self._draw_waiting(self._delay)
            if self._config.matching.kind == "search":
                self._walls_for(ends).add(
                    ends.in_map(place.pose), ends.bel / self._noise.variances(ends.ranges_m)[0]
                )

    def _match(self, ends: BeamEnds, place: Place) -> Match:
        matching = self._config.matching
        if isinstance(matching, NoMatching):
            return Match(place.pose, place.covariance, "off")
        if isinstance(matching, ShiftMatching):
            if not self._pos.grid.values.size:
                return Match(place.pose, place.covariance, "first")
            grid = self._pos.grid
            return match_by_shift(grid.values, grid.geometry, ends, place.pose, place.covariance, matching)
        if not len(ends):
            return Match(place.pose, place.covariance, "too_few_points")
        return self._walls_for(ends).match(ends, place.pose, place.covariance)

    def _walls_for(self, ends: BeamEnds) -> WallMatcher:
        """The map of the search; its scale is that of the first scan that shows anything."""
        config, matching = self._config, self._config.matching
        if self._walls is None:
            assert isinstance(matching, SearchMatching)
            window_m = matching.line_window_m or window_of([ends])
            self._walls = WallMatcher(
                matching, self._noise, config.resolution_m, window_m, config.memory_limit_mb
            )
        return self._walls

    def _draw_waiting(self, most: int) -> None:
        """Take the oldest of the waiting scans into the map until at most so many wait."""
        while len(self._waiting) > most:
            self._pos.add(*self._waiting.popleft())

    def _redraw_pos(self, poses: Floats) -> None:
        """The raw grid anew, under the adjusted poses."""
        self._pos = PosGrid(self._config.resolution_m, self._config.memory_limit_mb)
        for place, pose in zip(self._tracker.places, poses, strict=True):
            if place.ends is not None and len(place.ends):
                self._pos.add(place.ends, pose)


class IrScanLocalizer:
    """Finds the robot on a given map, stop by stop; the map stays as it is."""

    def __init__(self, config: IrScanConfig, seed: int, occupancy: OccupancyGrid) -> None:
        self._config = config
        self._tracker = Tracker(config, np.diag(np.square(config.start_deviation)))
        self._map = occupancy
        self._matcher: Matcher | None = None
        if config.matching.kind == "shift":
            self._matcher = GivenShiftMap(occupancy, config.matching)
        elif config.matching.kind == "search":
            self._matcher = GivenWallMap(occupancy, config.matching, noise_of(config), config.memory_limit_mb)

    @property
    def estimate(self) -> Estimate | None:
        """The pose at the last stop."""
        return estimate_of(self._tracker)

    def process(self, event: Event) -> None:
        """As in mapping."""
        place = self._tracker.take(event)
        if place is not None:
            self._visit(place)

    def result(self) -> RunResult:
        """The path and the table of stops."""
        if (place := self._tracker.finish()) is not None:
            self._visit(place)
        poses = np.array([place.pose for place in self._tracker.places])
        return result_of(self._tracker, poses, self._map, is_smooth=False)

    def _visit(self, place: Place) -> None:
        assert place.ends is not None
        match = Match(place.pose, place.covariance, "off")
        if self._matcher is not None:
            match = self._matcher.match(place.ends, place.pose, place.covariance)
        self._tracker.settle(place, match)


def noise_of(config: IrScanConfig) -> RangeNoise:
    """How well the rangers measure."""
    readings = config.readings
    return RangeNoise(readings.noise_m, readings.noise_per_m2, readings.bearing_rad)


def estimate_of(tracker: Tracker) -> Estimate | None:
    """The last stop's pose; None before the first one."""
    place = tracker.places[-1]
    return None if place.scan is None else Estimate(place.stamp_ns, place.pose)


def result_of(tracker: Tracker, poses: Floats, shown: OccupancyGrid, is_smooth: bool) -> RunResult:
    """What mapping and localization hand over alike."""
    tracker.end()
    path = trajectory(tracker.places, poses, tracker.motion.stretch(), is_smooth)
    picture = raw_and_filtered(tracker.places, shown)
    counters = Counter({name: n for name, n in tracker.all_counters().items() if n})
    return RunResult(
        path,
        tables={"stops": stops_table(tracker.places, poses)},
        series=series(tracker.places),
        pictures={} if picture is None else {"raw_and_filtered": picture},
        counters=dict(counters),
        measures=measures(tracker.places),
    )
