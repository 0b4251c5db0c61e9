"""From a stream of readings to scans: all samples of one stop (ir-scan, paper section 2.4).

The end of a sweep is recognised from the stream: the robot moves on, a sensor starts its next sweep, or no reading arrives. One
wild servo angle does not end a sweep.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Range
from gridslam.sensors.infrared import InfraredScan
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]

_TAU = math.tau
_FULL_CIRCLE_RAD = _TAU - 1e-3
_remainder = math.remainder
MAX_BEARING_RAD = 2.0 * math.tau
WILD_STEPS = 5.0  # a bearing this many median steps off, while its neighbours agree, is wrong
MIN_WILD_RAD = 0.1
STALE_RATIO = 0.01  # a first reading this close to the last one of the sweep before repeats it
FRESH_RATIO = 0.1  # unless the next reading is this close to it


@dataclass(frozen=True, slots=True)
class SweepLimits:
    """Limits that end a sweep: silence, motion of the robot, or a servo that reverses; a full circle ends it as well."""

    max_gap_s: float = 1.0
    max_travel_m: float = 0.005
    max_rotation_rad: float = 0.02
    reversal_rad: float = 0.35


@dataclass(slots=True)
class _SensorSweep:
    """The samples of one sensor in the open scan, and the angle (rad) that its servo has covered since the first of them."""

    readings: list[Range] = field(default_factory=list)
    angle: float = 0.0  # unwrapped
    lowest: float = 0.0
    highest: float = 0.0
    suspect: Range | None = None  # a reversal that the next sample confirms or refutes

    def is_next_sweep(self, angle: float, reversal_rad: float) -> bool:
        """Whether a sample at this angle belongs to the next sweep."""
        lowest, highest = self.lowest, self.highest
        if angle - lowest > _FULL_CIRCLE_RAD or highest - angle > _FULL_CIRCLE_RAD:
            return True
        if highest > -lowest:
            return highest - angle > reversal_rad
        return highest < -lowest and angle - lowest > reversal_rad

    def add(self, reading: Range, angle: float) -> None:
        """Add a sample of this sweep."""
        self.angle = angle
        if angle < self.lowest:
            self.lowest = angle
        elif angle > self.highest:
            self.highest = angle
        self.readings.append(reading)


@dataclass(frozen=True, slots=True)
class CompleteScan:
    """A complete scan, the stamp of its first sample, and the mark that `SweepAssembler.add` received with its last one."""

    scan: InfraredScan
    mark: int
    first_ns: int


class SweepAssembler:
    """Collects readings and returns each scan when it is complete."""

    def __init__(self, limits: SweepLimits) -> None:
        self._limits = limits
        self._gap_ns = limits.max_gap_s * 1e9
        self._sweeps: dict[str, _SensorSweep] = {}
        self._first_ns = self._last_ns = 0
        self._mark = 0
        self._travelled_m = self._rotated_rad = 0.0  # of the robot at the last sample
        self._last_range: dict[str, float] = {}  # of the scan before, by sensor
        self._max_sensors = 0
        self.counters: Counter[str] = Counter()
        self.sensor_extrinsics: dict[str, LidarExtrinsics] = {}

    def add(self, reading: Range, mark: int, travelled_m: float, rotated_rad: float) -> CompleteScan | None:
        """Add a reading; returns the scan before it if this reading starts a new scan.

        `mark` is returned with the scan. `travelled_m` and `rotated_rad` are the robot's path length (m) and absolute rotation
        (rad) since the start of the log.
        """
        bearing, stamp_ns = reading.bearing_rad, reading.stamp_ns
        if not -MAX_BEARING_RAD <= bearing <= MAX_BEARING_RAD:  # NaN fails too
            self.counters["skipped.range.bad_bearing"] += 1
            return None
        complete = None
        if self._sweeps and (
            abs(stamp_ns - self._last_ns) > self._gap_ns or self._has_moved(travelled_m, rotated_rad)
        ):
            complete = self.flush()
        sweep, angle = self._sweeps.get(reading.frame_id), 0.0
        if sweep is not None:
            last = sweep.readings[-1]
            if last.stamp_ns == stamp_ns and last == reading:
                self.counters["skipped.range.duplicate"] += 1
                return complete
            angle = sweep.angle + _remainder(bearing - last.bearing_rad, _TAU)
            if sweep.is_next_sweep(angle, self._limits.reversal_rad):
                return self._check_reversal(sweep, reading, mark, travelled_m, rotated_rad) or complete
            if sweep.suspect is not None:
                self.counters["skipped.range.bad_bearing"] += 1
                sweep.suspect = None
            sweep.add(reading, angle)
        else:
            if not self._sweeps:
                self._first_ns = stamp_ns
            self._sweeps[reading.frame_id] = _SensorSweep([reading])
        self._last_ns, self._mark = stamp_ns, mark
        self._travelled_m, self._rotated_rad = travelled_m, rotated_rad
        return complete

    def move(self, travelled_m: float, rotated_rad: float) -> CompleteScan | None:
        """Report motion of the robot, as in `add`; returns the scan that it ends, if any."""
        return self.flush() if self._sweeps and self._has_moved(travelled_m, rotated_rad) else None

    def flush(self) -> CompleteScan | None:
        """Close and return the open scan, complete or not; None without one."""
        if not self._sweeps:
            return None
        sweeps, self._sweeps = self._sweeps, {}
        self.counters["skipped.range.bad_bearing"] += sum(s.suspect is not None for s in sweeps.values())
        kept = {name: self._without_errors(name, sweep.readings) for name, sweep in sorted(sweeps.items())}
        for name, sweep in sweeps.items():
            self._last_range[name] = sweep.readings[-1].range_m
        self._max_sensors = max(self._max_sensors, len(sweeps))
        self.counters["scan.missing_sensor"] += len(sweeps) < self._max_sensors
        scan = scan_of(self._last_ns, kept, self.sensor_extrinsics)
        self.counters["scan.one_sample"] += len(scan) == 1
        return CompleteScan(scan, self._mark, self._first_ns)

    def _check_reversal(
        self, sweep: _SensorSweep, reading: Range, mark: int, travelled_m: float, rotated_rad: float
    ) -> CompleteScan | None:
        """Set a reversed sample aside until a second one confirms it; the two then start the next scan."""
        suspect, sweep.suspect = sweep.suspect, None
        if suspect is None or not self._is_near(reading, suspect):
            self.counters["skipped.range.bad_bearing"] += suspect is not None
            sweep.suspect = reading
            return None
        others = self._take_suspects()
        complete = self.flush()
        for first in (*others, suspect, reading):
            self.add(first, mark, travelled_m, rotated_rad)
        return complete

    def _take_suspects(self) -> list[Range]:
        """Remove and return the samples of other sensors that belong to the next scan."""
        found = [sweep.suspect for sweep in self._sweeps.values() if sweep.suspect is not None]
        for sweep in self._sweeps.values():
            sweep.suspect = None
        return found

    def _is_near(self, reading: Range, other: Range) -> bool:
        difference = math.remainder(reading.bearing_rad - other.bearing_rad, math.tau)
        return abs(difference) <= self._limits.reversal_rad

    def _has_moved(self, travelled_m: float, rotated_rad: float) -> bool:
        limits = self._limits
        distance, rotation = travelled_m - self._travelled_m, rotated_rad - self._rotated_rad
        return distance > limits.max_travel_m or rotation > limits.max_rotation_rad

    def _without_errors(self, name: str, readings: list[Range]) -> list[Range]:
        """The readings without wild bearings and without a first one that repeats the scan before."""
        wild = wild_bearings(np.array([r.bearing_rad for r in readings]))
        self.counters["skipped.range.bad_bearing"] += int(wild.sum())
        kept = [r for r, is_wild in zip(readings, wild.tolist(), strict=True) if not is_wild]
        if len(kept) > 1 and is_stale(kept[0].range_m, kept[1].range_m, self._last_range.get(name)):
            self.counters["skipped.range.stale"] += 1
            return kept[1:]
        return kept


def is_stale(first_m: float, second_m: float, last_m: float | None) -> bool:
    """Whether the first reading of a sweep repeats the last one of the sweep before, which the driver sent again.

    It is if it repeats that one to 1 % and differs from the next reading by more than 10 %.
    """
    if last_m is None:
        return False
    is_repeated = abs(first_m - last_m) <= STALE_RATIO * abs(last_m)
    return is_repeated and abs(second_m - first_m) > FRESH_RATIO * abs(first_m)


def wild_bearings(bearings: Floats) -> NDArray[np.bool_]:
    """Mask `(n,)` of the servo angles that are far from both neighbours although these are near to each other."""
    n = len(bearings)
    wild = np.zeros(n, bool)
    if n < 3:
        return wild
    step = np.abs(_wrapped(np.diff(bearings)))
    far = max(WILD_STEPS * float(np.median(step)), MIN_WILD_RAD)
    between_neighbours = np.abs(_wrapped(bearings[2:] - bearings[:-2]))
    wild[1:-1] = (step[:-1] > far) & (step[1:] > far) & (between_neighbours < far)
    wild[0] = step[0] > far and step[1] <= far
    wild[-1] = step[-1] > far and step[-2] <= far
    return wild


def scan_of(
    stamp_ns: int, readings: Mapping[str, list[Range]], sensor_extrinsics: Mapping[str, LidarExtrinsics]
) -> InfraredScan:
    """Readings by sensor as one scan; a sensor without extrinsics is at the robot's centre."""
    names = tuple(readings)
    flat = [(k, r) for k, name in enumerate(names) for r in readings[name]]
    values = np.array(
        [(r.bearing_rad, r.range_m, r.range_min_m, r.range_max_m) for _, r in flat], np.float64
    ).reshape(-1, 4)
    bearing, range_m, low, high = (np.ascontiguousarray(column) for column in values.T)
    return InfraredScan(
        stamp_ns=stamp_ns,
        names=names,
        sensor_extrinsics=tuple(sensor_extrinsics.get(name, LidarExtrinsics(np.zeros(3))) for name in names),
        sensor=np.array([k for k, _ in flat], np.int64),
        bearing_rad=bearing,
        range_m=range_m,
        range_min_m=low,
        range_max_m=high,
    )


def _wrapped(angle: Floats) -> Floats:
    return np.asarray(np.remainder(angle + np.pi, math.tau) - np.pi)
