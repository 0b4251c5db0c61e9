from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gridslam.core.messages import Range
from gridslam.sensors.infrared_sweeps import (
    CompleteScan,
    SweepAssembler,
    SweepLimits,
    is_stale,
    wild_bearings,
)

STEP_NS = 20_000_000


def reading(k: int, degrees: float, value: float = 0.5, name: str = "front") -> Range:
    return Range(k * STEP_NS, name, math.radians(degrees), value, 0.1, 0.8)


def fed(sweeps: SweepAssembler, readings: Iterable[Range], travelled_m: float = 0.0) -> list[CompleteScan]:
    return [scan for r in readings if (scan := sweeps.add(r, 7, travelled_m, 0.0)) is not None]


def sweep(first: int = 0, name: str = "front", value: float = 0.5) -> list[Range]:
    return [reading(first + k, k - 60.0, value + 1e-3 * k, name) for k in range(121)]


def test_motion_ends_a_scan_of_any_number_of_samples() -> None:
    for count in (1, 5, 121, 300):
        sweeps = SweepAssembler(SweepLimits())
        assert fed(sweeps, (reading(k, 0.2 * k - 30.0) for k in range(count))) == []
        assert sweeps.move(0.001, 0.0) is None
        scan = sweeps.move(0.02, 0.0)
        assert scan is not None
        assert len(scan.scan) == count
        assert scan.mark == 7
        assert scan.scan.stamp_ns == (count - 1) * STEP_NS
        assert sweeps.counters["scan.one_sample"] == (count == 1)


def test_a_reading_after_motion_or_silence_starts_the_next_scan() -> None:
    sweeps = SweepAssembler(SweepLimits())
    fed(sweeps, sweep())
    (done,) = fed(sweeps, [reading(121, -60.0)], travelled_m=0.4)
    assert len(done.scan) == 121
    (done,) = fed(sweeps, [reading(500, -60.0)], travelled_m=0.4)
    assert len(done.scan) == 1


def test_a_servo_that_starts_its_next_sweep_ends_the_scan_of_all_sensors() -> None:
    sweeps = SweepAssembler(SweepLimits())
    both = [r for pair in zip(sweep(), sweep(name="left"), strict=True) for r in pair]
    assert fed(sweeps, both) == []
    again = [r for pair in zip(sweep(121), sweep(121, "left"), strict=True) for r in pair]
    (done,) = fed(sweeps, again)
    assert done.scan.names == ("front", "left")
    assert len(done.scan) == 242
    rest = sweeps.flush()
    assert rest is not None
    assert len(rest.scan) == 242
    assert sweeps.counters["skipped.range.bad_bearing"] == 0


def test_sensors_that_sweep_one_after_the_other_form_one_scan() -> None:
    sweeps = SweepAssembler(SweepLimits())
    assert fed(sweeps, [*sweep(), *sweep(121, "left"), *sweep(242, "right")]) == []
    scan = sweeps.flush()
    assert scan is not None
    assert len(scan.scan) == 363


def test_a_servo_that_reverses_starts_the_next_scan_and_no_reading_is_lost() -> None:
    sweeps = SweepAssembler(SweepLimits())
    there = [reading(k, 2.0 * k) for k in range(60)]
    back = [reading(60 + k, 118.0 - 2.0 * k) for k in range(60)]
    (done,) = fed(sweeps, there + back)
    rest = sweeps.flush()
    assert rest is not None
    assert len(done.scan) + len(rest.scan) == 120
    assert abs(len(done.scan) - 60) < 15


def test_a_full_circle_ends_a_scan_of_a_rotating_sensor() -> None:
    sweeps = SweepAssembler(SweepLimits())
    circles = [reading(k, math.degrees(math.remainder(math.radians(1.8 * k), math.tau))) for k in range(600)]
    done = fed(sweeps, circles)
    assert [len(scan.scan) for scan in done] == [200, 200]


def test_one_wild_servo_angle_does_not_end_the_scan_and_is_skipped() -> None:
    for at in (0, 30, 120):
        sweeps = SweepAssembler(SweepLimits())
        readings = sweep()
        readings[at] = reading(at, 170.0 if at else -170.0)
        done = fed(sweeps, readings)
        last = sweeps.flush()
        assert last is not None
        kept = np.concatenate([scan.scan.bearing_rad for scan in [*done, last]])
        assert np.abs(kept).max() <= math.radians(60.0) + 1e-9
        assert sweeps.counters["skipped.range.bad_bearing"] == 1


def test_bearings_that_are_no_angles_are_counted() -> None:
    sweeps = SweepAssembler(SweepLimits())
    fed(sweeps, [reading(0, math.nan), reading(1, math.inf), reading(2, 1e6)])
    assert sweeps.flush() is None
    assert sweeps.counters["skipped.range.bad_bearing"] == 3


def test_duplicated_samples_count_once() -> None:
    sweeps = SweepAssembler(SweepLimits())
    fed(sweeps, [r for r in sweep() for _ in range(2)])
    scan = sweeps.flush()
    assert scan is not None
    assert len(scan.scan) == 121
    assert sweeps.counters["skipped.range.duplicate"] == 121


def test_a_first_reading_that_repeats_the_stop_before_is_stale() -> None:
    sweeps = SweepAssembler(SweepLimits())
    fed(sweeps, sweep(value=0.6))
    next_stop = sweep(121, value=0.3)
    next_stop[0] = reading(121, -60.0, 0.72)  # the last sweep ended with 0.72
    fed(sweeps, next_stop, travelled_m=0.4)
    scan = sweeps.flush()
    assert scan is not None
    assert len(scan.scan) == 120
    assert sweeps.counters["skipped.range.stale"] == 1
    assert not is_stale(0.72, 0.71, 0.72)
    assert not is_stale(0.72, 0.3, None)


def test_a_missing_sensor_is_counted_at_every_stop() -> None:
    sweeps = SweepAssembler(SweepLimits())
    for stop in range(3):
        readings = sweep(1000 * stop)
        readings += sweep(1000 * stop, "left") if stop == 0 else []
        fed(sweeps, sorted(readings, key=lambda r: r.stamp_ns), travelled_m=0.4 * stop)
    sweeps.flush()
    assert sweeps.counters["scan.missing_sensor"] == 2


def test_bearings_are_wild_only_if_their_neighbours_agree() -> None:
    steady = np.radians(np.arange(-60.0, 61.0))
    assert not wild_bearings(steady).any()
    assert not wild_bearings(np.r_[steady, steady]).any()
    assert not wild_bearings(np.array([0.0, 3.0])).any()
    damaged = steady.copy()
    damaged[[0, 50, 120]] += 2.0
    assert np.flatnonzero(wild_bearings(damaged)).tolist() == [0, 50, 120]
