"""Mapping and localization with infrared rangers on servos, stop by stop: predict, match, correct, update the map."""

from __future__ import annotations

from collections import deque
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
from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.given_map import GivenShiftMap, GivenWallMap
from gridslam.methods.ir_scan.pictures import raw_and_filtered
from gridslam.methods.ir_scan.pos_grid import PosGrid
from gridslam.methods.ir_scan.record import measures, series, stops_table, trajectory
from gridslam.methods.ir_scan.scale import scans_of, window_of
from gridslam.methods.ir_scan.shift_matching import ShiftSettings, match_by_shift
from gridslam.methods.ir_scan.stops import Stop, StopMatch
from gridslam.methods.ir_scan.surfaces import draw_surfaces
from gridslam.methods.ir_scan.tracker import StopTracker
from gridslam.methods.ir_scan.wall_matching import SearchSettings, WallMatcher
from gridslam.sensors.infrared import RangeNoise, ReliableReadings

Floats = NDArray[np.float64]


class ScanMatcher(Protocol):
    """Finds the pose of a scan near a predicted pose."""

    def match(self, readings: ReliableReadings, prior: StopMatch) -> StopMatch:
        """The corrected pose; or the predicted pose `prior`, with a verdict that says why it was not corrected."""


class IrScanMapper:
    """Maps a log. `result` adjusts all stops together and draws the map, as configured."""

    def __init__(self, config: IrScanConfig, seed: int) -> None:
        start()
        self._config = config
        self._noise = noise_of(config)
        self._tracker = StopTracker(config, np.zeros((3, 3)))
        self._pos = PosGrid(config.resolution_m, config.advanced.memory_limit_mb)
        # Recent scans share the present error of the odometry, and a map that holds them would confirm it.
        self._delay = config.advanced.matching.delay_stops if config.matching.kind == "shift" else 0
        # Readings that are not in the map yet, with their poses
        self._delayed: deque[tuple[ReliableReadings, Floats]] = deque()
        self._walls: WallMatcher | None = None
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The pose at the last stop."""
        return estimate_of(self._tracker)

    def process(self, event: Event) -> None:
        """Readings, wheel angles or odometry, yaw rates, absolute poses and static transforms are used."""
        stop = self._tracker.add(event)
        if stop is not None:
            self._visit(stop)

    def result(self) -> RunResult:
        """The map, the path, the grid pos, and the table of stops."""
        if (stop := self._tracker.finish()) is not None:
            self._visit(stop)
        self._draw_delayed(0)
        config, stops = self._config, self._tracker.stops
        poses = np.array([stop.pose for stop in stops])
        if config.adjustment.enabled and len(stops) > 1:
            with self._stopwatch.stage("adjust"):
                poses = adjust(stops, window_of(scans_of(stops)), self._noise)
                self._redraw_pos(poses)
        with self._stopwatch.stage("draw"):
            occupancy = self._pos.occupancy()
            if config.drawing.kind == "surfaces":
                occupancy = draw_surfaces(
                    stops, poses, self._noise, config.resolution_m, config.advanced.memory_limit_mb
                )
        with self._stopwatch.stage("report"):
            result = result_of(self._tracker, poses, occupancy, is_smooth=config.adjustment.enabled)
        timings = dict(self._stopwatch.seconds)
        return replace(result, occupancy=occupancy, layers={"pos": self._pos.layer()}, timings_s=timings)

    def _visit(self, stop: Stop) -> None:
        """Match the scan of a stop, correct its pose, and add the scan to the map."""
        readings = stop.readings
        assert readings is not None
        with self._stopwatch.stage("match"):
            match = self._match(readings, predicted_at(stop))
        self._tracker.apply_match(stop, match)
        if not len(readings):
            return
        with self._stopwatch.stage("update_map"):
            self._delayed.append((readings, stop.pose))
            self._draw_delayed(self._delay)
            if self._config.matching.kind == "search":
                along_beam, _ = self._noise.variances(readings.ranges_m)
                self._walls_for(readings).add(readings.in_map(stop.pose), readings.bel / along_beam)

    def _match(self, readings: ReliableReadings, prior: StopMatch) -> StopMatch:
        kind = self._config.matching.kind
        if kind == "none":
            return prior
        if kind == "shift":
            if not self._pos.grid.values.size:
                return replace(prior, verdict="first")
            grid = self._pos.grid
            return match_by_shift(grid.values, grid.geometry, readings, prior, shift_settings(self._config))
        if not len(readings):
            return replace(prior, verdict="too_few_points")
        return self._walls_for(readings).match(readings, prior)

    def _walls_for(self, readings: ReliableReadings) -> WallMatcher:
        """The map of the search; the size of its windows follows from the first scan with any readings."""
        config = self._config
        if self._walls is None:
            self._walls = WallMatcher(
                search_settings(config),
                self._noise,
                resolution_m=config.resolution_m,
                window_m=window_of([readings]),
                memory_limit_mb=config.advanced.memory_limit_mb,
            )
        return self._walls

    def _draw_delayed(self, max_delayed: int) -> None:
        """Add the oldest delayed scans to the map until at most `max_delayed` remain."""
        while len(self._delayed) > max_delayed:
            self._pos.add(*self._delayed.popleft())

    def _redraw_pos(self, poses: Floats) -> None:
        """Draw the grid pos again with the adjusted poses `(s, 3)` of the stops."""
        self._pos = PosGrid(self._config.resolution_m, self._config.advanced.memory_limit_mb)
        for stop, pose in zip(self._tracker.stops, poses, strict=True):
            if stop.readings is not None and len(stop.readings):
                self._pos.add(stop.readings, pose)


class IrScanLocalizer:
    """Localizes the robot on a given map, stop by stop; the map does not change."""

    def __init__(self, config: IrScanConfig, seed: int, occupancy: OccupancyGrid) -> None:
        self._config = config
        self._tracker = StopTracker(config, np.diag(np.square(config.advanced.start_std)))
        self._map = occupancy
        self._matcher: ScanMatcher | None = None
        if config.matching.kind == "shift":
            self._matcher = GivenShiftMap(occupancy, shift_settings(config))
        elif config.matching.kind == "search":
            limit_mb = config.advanced.memory_limit_mb
            self._matcher = GivenWallMap(occupancy, search_settings(config), noise_of(config), limit_mb)

    @property
    def estimate(self) -> Estimate | None:
        """The pose at the last stop."""
        return estimate_of(self._tracker)

    def process(self, event: Event) -> None:
        """The same events are used as in mapping."""
        stop = self._tracker.add(event)
        if stop is not None:
            self._visit(stop)

    def result(self) -> RunResult:
        """The path and the table of stops."""
        if (stop := self._tracker.finish()) is not None:
            self._visit(stop)
        poses = np.array([stop.pose for stop in self._tracker.stops])
        return result_of(self._tracker, poses, self._map, is_smooth=False)

    def _visit(self, stop: Stop) -> None:
        assert stop.readings is not None
        match = predicted_at(stop)
        if self._matcher is not None:
            match = self._matcher.match(stop.readings, match)
        self._tracker.apply_match(stop, match)


def predicted_at(stop: Stop) -> StopMatch:
    """The predicted pose of a stop, as the result of a match that was not tried (verdict `off`)."""
    return StopMatch(stop.pose, stop.covariance, "off")


def noise_of(config: IrScanConfig) -> RangeNoise:
    """The noise of the rangers."""
    readings = config.readings
    return RangeNoise(readings.noise_m, readings.noise_per_m2, readings.bearing_rad)


def shift_settings(config: IrScanConfig) -> ShiftSettings:
    """The settings of the paper's match."""
    advanced = config.advanced.matching
    return ShiftSettings(
        window_cells=config.matching.window_cells,
        min_points=advanced.min_points,
        min_inlier_ratio=advanced.min_inlier_ratio,
        tie_sigmas=advanced.tie_sigmas,
    )


def search_settings(config: IrScanConfig) -> SearchSettings:
    """The settings of the match by search."""
    advanced = config.advanced.matching
    return SearchSettings(
        window_cells=config.matching.window_cells,
        rotation_rad=advanced.rotation_rad,
        min_points=advanced.min_points,
        max_position_std_m=advanced.max_position_std_m,
    )


def estimate_of(tracker: StopTracker) -> Estimate | None:
    """The pose of the last stop; None before the first one."""
    stop = tracker.stops[-1]
    return None if stop.scan is None else Estimate(stop.stamp_ns, stop.pose)


def result_of(tracker: StopTracker, poses: Floats, occupancy: OccupancyGrid, is_smooth: bool) -> RunResult:
    """The part of the result that mapping and localization have in common; `poses` `(s, 3)` are those of the stops.

    `is_smooth`: the correction of each stop is distributed over the path to it.
    """
    tracker.advance_to_end()
    picture = raw_and_filtered(tracker.stops, occupancy)
    return RunResult(
        trajectory(tracker.stops, poses, tracker.motion_since_stop(), is_smooth),
        tables={"stops": stops_table(tracker.stops, poses)},
        series=series(tracker.stops),
        pictures={} if picture is None else {"raw_and_filtered": picture},
        counters={name: n for name, n in tracker.all_counters().items() if n},
        measures=measures(tracker.stops),
    )
