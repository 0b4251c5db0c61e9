from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.sensors.infrared import InfraredScan, RangeNoise, reliability, reliable_readings, spacing_m
from gridslam.sensors.lidar_beams import LidarExtrinsics

FRONT = LidarExtrinsics(np.array([0.1, 0.0, 0.0]))


def scan(
    ranges: list[float],
    sensor: list[int] | None = None,
    sensor_extrinsics: tuple[LidarExtrinsics, ...] = (FRONT,),
) -> InfraredScan:
    n = len(ranges)
    return InfraredScan(
        0,
        tuple(f"ir{k}" for k in range(len(sensor_extrinsics))),
        sensor_extrinsics,
        np.array(sensor or [0] * n, np.int64),
        np.radians(np.arange(n, dtype=np.float64)),
        np.array(ranges, np.float64),
        np.full(n, 0.2),
        np.full(n, 1.5),
    )


def test_reliability_is_1_a_half_or_0_by_the_number_of_agreeing_neighbours() -> None:
    """Section 2.5, T = 0.05: inside, beside a step, alone between two, and at both ends of the sweep."""
    bel = reliability(scan([0.50, 0.51, 0.52, 0.80, 1.20, 1.21]), 0.05)
    assert bel.tolist() == [1.0, 1.0, 0.5, 0.0, 0.5, 1.0]


def test_an_end_of_a_sweep_that_differs_from_its_only_neighbour_has_no_reliability() -> None:
    assert reliability(scan([4.72, 1.13, 1.12]), 0.05)[0] == 0.0
    assert reliability(scan([0.9, 0.5, 0.51]), 0.05).tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize("value", [0.2, 1.5, 0.1, 1.6, 0.0, math.nan, math.inf, -1.0])
def test_readings_not_strictly_inside_the_range_have_no_reliability(value: float) -> None:
    assert reliability(scan([value, value, value]), 10.0).tolist() == [0.0, 0.0, 0.0]


def test_a_difference_equal_to_the_threshold_gives_no_support() -> None:
    assert reliability(scan([0.5, 0.75]), 0.25).tolist() == [0.0, 0.0]


def test_a_single_sample_has_no_reliability_and_an_empty_scan_is_allowed() -> None:
    assert reliability(scan([0.5]), 0.05).tolist() == [0.0]
    assert reliability(scan([]), 0.05).shape == (0,)


def test_readings_of_different_sensors_are_not_neighbours() -> None:
    both = (FRONT, FRONT)
    assert reliability(scan([0.5, 0.5, 0.5, 0.9], [0, 0, 1, 1], both), 0.05).tolist() == [1.0, 1.0, 0.0, 0.0]


def test_end_points_account_for_extrinsics_servo_angle_and_an_upside_down_sensor() -> None:
    left = LidarExtrinsics(np.array([0.0, 0.08, math.pi / 2]))
    flipped = LidarExtrinsics(np.array([0.0, 0.0, 0.0]), flipped=True)
    mixed = scan([1.0, 1.0, 1.0], [0, 1, 2], (FRONT, left, flipped))
    mixed = InfraredScan(
        0,
        mixed.names,
        mixed.sensor_extrinsics,
        mixed.sensor,
        np.full(3, math.pi / 6),
        *(mixed.range_m, mixed.range_min_m, mixed.range_max_m),
    )
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    assert np.allclose(mixed.endpoints(), [[0.1 + c, s], [-s, 0.08 + c], [c, -s]])


def test_variance_along_a_normal_combines_range_and_servo_noise() -> None:
    readings = reliable_readings(scan([1.0, 1.0]), np.ones(2))
    noise = RangeNoise(0.01, 0.0, 0.02)
    along, across = readings.directions, readings.directions @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert np.allclose(readings.variances(along, noise), 0.01**2)
    assert np.allclose(readings.variances(across, noise), 0.02**2)


def test_spacing_is_that_of_consecutive_samples_only() -> None:
    readings = reliable_readings(scan([1.0, 1.0, 0.5, 1.0, 1.0]), np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    assert spacing_m([readings]) == pytest.approx(2.0 * math.sin(math.radians(0.5)))
    assert math.isnan(spacing_m([]))
