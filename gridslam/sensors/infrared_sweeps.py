"""From a stream of readings to scans: all samples of one stop (ir-scan, paper section 2.4).

Nothing tells where a sweep ends but the stream itself: the robot moves on, a sensor that has swept begins anew, or there is
silence. A servo that reports a wild angle once does not end a sweep.
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
_WHOLE_TURN = _TAU - 1e-3
_remainder = math.remainder
_LARGEST_BEARING_RAD = 2.0 * math.tau
_WILD_STEPS = 5.0  # a bearing that is so many usual steps off, while its neighbours agree, is wrong
_LEAST_WILD_RAD = 0.1


@dataclass(frozen=True, slots=True)
class SweepLimits:
    """What ends a sweep: silence, motion, or a servo that turned back so far (a whole turn ends one as well)."""

    gap_s: float = 1.0
    moved_m: float = 0.005
    moved_rad: float = 0.02
    back_rad: float = 0.35


@dataclass(slots=True)
class _Track:
    """The samples of one sensor in the scan that is open, and how far its servo has gone."""

    readings: list[Range] = field(default_factory=list)
    turned: float = 0.0  # since the first sample, unwrapped
    lowest: float = 0.0
    highest: float = 0.0
    doubted: Range | None = None  # turned back, perhaps by mistake: the next sample tells

    def turns_anew(self, turned: float, back_rad: float) -> bool:
        """Whether a sample so far from the first one cannot belong to this sweep any more."""
        lowest, highest = self.lowest, self.highest
        if turned - lowest > _WHOLE_TURN or highest - turned > _WHOLE_TURN:
            return True
        if highest > -lowest:
            return highest - turned > back_rad
        return highest < -lowest and turned - lowest > back_rad

    def add(self, reading: Range, turned: float) -> None:
        """Take in a sample that belongs to the sweep."""
        self.turned = turned
        if turned < self.lowest:
            self.lowest = turned
        elif turned > self.highest:
            self.highest = turned
        self.readings.append(reading)


@dataclass(frozen=True, slots=True)
class OpenedScan:
    """A scan that is complete, and the mark that `SweepAssembler.add` was given with its last sample."""

    scan: InfraredScan
    mark: int
    first_ns: int


class SweepAssembler:
    """Collects readings; hands out a scan when it is complete."""

    def __init__(self, limits: SweepLimits) -> None:
        self._limits = limits
        self._gap_ns = limits.gap_s * 1e9
        self._tracks: dict[str, _Track] = {}
        self._first_ns = self._last_ns = 0
        self._mark = 0
        self._travelled_m = self._turned_rad = 0.0  # of the robot at the last sample
        self._last_value: dict[str, float] = {}  # of the scan before, by sensor
        self._most_sensors = 0
        self.counters: Counter[str] = Counter()
        self.sensor_extrinsics: dict[str, LidarExtrinsics] = {}

    def add(self, reading: Range, mark: int, travelled_m: float, turned_rad: float) -> OpenedScan | None:
        """Take in a reading; returns the scan before it when this one begins a new scan.

        `mark` is handed back with the scan; travelled and turned are the robot's since the beginning.
        """
        bearing, stamp_ns = reading.bearing_rad, reading.stamp_ns
        if not -_LARGEST_BEARING_RAD <= bearing <= _LARGEST_BEARING_RAD:  # NaN fails too
            self.counters["skipped.range.bad_bearing"] += 1
            return None
        done = None
        if self._tracks and (
            abs(stamp_ns - self._last_ns) > self._gap_ns or self._has_moved(travelled_m, turned_rad)
        ):
            done = self.flush()
        track, turned = self._tracks.get(reading.frame_id), 0.0
        if track is not None:
            last = track.readings[-1]
            if last.stamp_ns == stamp_ns and last == reading:
                self.counters["skipped.range.duplicate"] += 1
                return done
            turned = track.turned + _remainder(bearing - last.bearing_rad, _TAU)
            if track.turns_anew(turned, self._limits.back_rad):
                return self._doubt(track, reading, mark, travelled_m, turned_rad) or done
            if track.doubted is not None:
                self.counters["skipped.range.bad_bearing"] += 1
                track.doubted = None
            track.add(reading, turned)
        else:
            if not self._tracks:
                self._first_ns = stamp_ns
            self._tracks[reading.frame_id] = _Track([reading])
        self._last_ns, self._mark = stamp_ns, mark
        self._travelled_m, self._turned_rad = travelled_m, turned_rad
        return done

    def moved(self, travelled_m: float, turned_rad: float) -> OpenedScan | None:
        """Told of motion: returns the scan that it ends, if it does."""
        return self.flush() if self._tracks and self._has_moved(travelled_m, turned_rad) else None

    def flush(self) -> OpenedScan | None:
        """The scan that is open, complete or not; None where there is none."""
        if not self._tracks:
            return None
        tracks, self._tracks = self._tracks, {}
        self.counters["skipped.range.bad_bearing"] += sum(t.doubted is not None for t in tracks.values())
        kept = {name: self._sound(name, track.readings) for name, track in sorted(tracks.items())}
        for name, track in tracks.items():
            self._last_value[name] = track.readings[-1].range_m
        self._most_sensors = max(self._most_sensors, len(tracks))
        self.counters["scan.missing_sensor"] += len(tracks) < self._most_sensors
        scan = scan_of(self._last_ns, kept, self.sensor_extrinsics)
        self.counters["scan.one_sample"] += len(scan) == 1
        return OpenedScan(scan, self._mark, self._first_ns)

    def _doubt(
        self, track: _Track, reading: Range, mark: int, travelled_m: float, turned_rad: float
    ) -> OpenedScan | None:
        """A sample that turned back: kept apart until a second one says the same, which begins the next scan."""
        doubted, track.doubted = track.doubted, None
        if doubted is None or not self._is_near(reading, doubted):
            self.counters["skipped.range.bad_bearing"] += doubted is not None
            track.doubted = reading
            return None
        carried = self._take_doubted()
        done = self.flush()
        for first in (*carried, doubted, reading):
            self.add(first, mark, travelled_m, turned_rad)
        return done

    def _take_doubted(self) -> list[Range]:
        """What other sensors have begun of the next scan."""
        found = [track.doubted for track in self._tracks.values() if track.doubted is not None]
        for track in self._tracks.values():
            track.doubted = None
        return found

    def _is_near(self, reading: Range, other: Range) -> bool:
        return abs(math.remainder(reading.bearing_rad - other.bearing_rad, math.tau)) <= self._limits.back_rad

    def _has_moved(self, travelled_m: float, turned_rad: float) -> bool:
        limits = self._limits
        way, turn = travelled_m - self._travelled_m, turned_rad - self._turned_rad
        return way > limits.moved_m or turn > limits.moved_rad

    def _sound(self, name: str, readings: list[Range]) -> list[Range]:
        """The readings without wild bearings and without a first one that repeats the scan before."""
        wild = wild_bearings(np.array([r.bearing_rad for r in readings]))
        self.counters["skipped.range.bad_bearing"] += int(wild.sum())
        kept = [r for r, is_wild in zip(readings, wild.tolist(), strict=True) if not is_wild]
        if len(kept) > 1 and is_stale(kept[0].range_m, kept[1].range_m, self._last_value.get(name)):
            self.counters["skipped.range.stale"] += 1
            return kept[1:]
        return kept


def is_stale(first_m: float, second_m: float, last_m: float | None) -> bool:
    """Whether the first reading of a sweep is the last one of the sweep before, delivered once more.

    It repeats that to 1 % and is off the next reading by more than 10 %.
    """
    if last_m is None:
        return False
    return abs(first_m - last_m) <= 0.01 * abs(last_m) and abs(second_m - first_m) > 0.1 * abs(first_m)


def wild_bearings(bearings: Floats) -> NDArray[np.bool_]:
    """Which servo angles `(n,)` are far from both neighbours although these are near to each other."""
    n = len(bearings)
    wild = np.zeros(n, bool)
    if n < 3:
        return wild
    step = np.abs(_wrapped(np.diff(bearings)))
    far = max(_WILD_STEPS * float(np.median(step)), _LEAST_WILD_RAD)
    across = np.abs(_wrapped(bearings[2:] - bearings[:-2]))
    wild[1:-1] = (step[:-1] > far) & (step[1:] > far) & (across < far)
    wild[0] = step[0] > far and step[1] <= far
    wild[-1] = step[-1] > far and step[-2] <= far
    return wild


def scan_of(
    stamp_ns: int, readings: Mapping[str, list[Range]], sensor_extrinsics: Mapping[str, LidarExtrinsics]
) -> InfraredScan:
    """Readings by sensor as one scan; a sensor without a extrinsics sits at the robot's centre."""
    names = tuple(readings)
    flat = [(k, r) for k, name in enumerate(names) for r in readings[name]]
    values = np.array(
        [(r.bearing_rad, r.range_m, r.range_min_m, r.range_max_m) for _, r in flat], np.float64
    ).reshape(-1, 4)
    return InfraredScan(
        stamp_ns,
        names,
        tuple(sensor_extrinsics.get(name, LidarExtrinsics(np.zeros(3))) for name in names),
        np.array([k for k, _ in flat], np.int64),
        *(np.ascontiguousarray(column) for column in values.T),
    )


def _wrapped(angle: Floats) -> Floats:
    return np.asarray(np.remainder(angle + np.pi, math.tau) - np.pi)
