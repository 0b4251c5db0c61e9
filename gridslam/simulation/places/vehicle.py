"""The robot that travels through a place: lidar, odometry and their errors, drawn by seed.

The odometry's drift is 2 to 5 %: the mean relative error of position over all stretches of 100 m, as a fraction of their length.
Wheels of unequal radii and slip that lasts turn the heading, a constant slip shortens the path, and now and then wheels spin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gridslam.core.arrays import cumulative_distance
from gridslam.simulation.driving.robot_config import GripLosses, Wheels
from gridslam.simulation.places.config import Kind
from gridslam.simulation.places.layout import XY
from gridslam.simulation.sensors.sensor_config import Lidar, SensorExtrinsics, WheelOdometry
from gridslam.simulation.sensors.sensor_suite import Sensors


class Scanner(NamedTuple):
    """A make of lidar: beams over a field of view, largest range, standard deviation and step of its ranges."""

    beams: int
    field_of_view_deg: float
    range_max_m: float
    noise_m: float
    resolution_m: float


INDOORS = (
    Scanner(beams=181, field_of_view_deg=180.0, range_max_m=8.0, noise_m=0.012, resolution_m=0.01),
    Scanner(beams=360, field_of_view_deg=360.0, range_max_m=12.0, noise_m=0.02, resolution_m=0.01),
    Scanner(beams=271, field_of_view_deg=270.0, range_max_m=25.0, noise_m=0.015, resolution_m=0.001),
    Scanner(beams=541, field_of_view_deg=270.0, range_max_m=30.0, noise_m=0.012, resolution_m=0.001),
    Scanner(beams=181, field_of_view_deg=180.0, range_max_m=80.0, noise_m=0.02, resolution_m=0.01),
)
OUTDOORS = (
    Scanner(beams=361, field_of_view_deg=180.0, range_max_m=80.0, noise_m=0.02, resolution_m=0.01),
    Scanner(beams=541, field_of_view_deg=270.0, range_max_m=30.0, noise_m=0.015, resolution_m=0.001),
    Scanner(beams=541, field_of_view_deg=270.0, range_max_m=50.0, noise_m=0.02, resolution_m=0.001),
    Scanner(beams=720, field_of_view_deg=360.0, range_max_m=60.0, noise_m=0.02, resolution_m=0.005),
)
BASE_M = 0.45
STRETCH_M, SAMPLE_M = 100.0, 0.5
YAW_ERROR_PER_M, SCALE_ERROR = 0.018, 0.3  # of a drift of 1, on a straight path
SCAN_RATES_HZ = (2.5, 4.0, 5.0, 6.0)


def sensors(kind: Kind, rng: np.random.Generator) -> Sensors:
    """A lidar that loses readings and reads wildly now and then, and odometry from encoders."""
    makes = OUTDOORS if kind == "campus" else INDOORS
    make = makes[int(rng.integers(len(makes)))]
    rate = float(rng.choice(SCAN_RATES_HZ))
    lidar = Lidar(
        extrinsics=SensorExtrinsics(x=round(float(rng.uniform(0.0, 0.25)), 3), z=0.3),
        **make._asdict(),
        rate_hz=rate,
        sweep_s=float(rng.choice([0.025, 0.05, 0.1])),
        latency_s=0.005,
        jitter_s=0.002,
        missing=0.003,
        dropout=round(float(rng.uniform(0.003, 0.03)), 4),
        outliers=round(float(rng.uniform(0.0005, 0.004)), 5),
    )
    return Sensors(lidar=lidar, odometry=WheelOdometry(rate_hz=12.5, jitter_s=0.001, missing=0.002))


def wheels(route: Sequence[XY], rng: np.random.Generator) -> Wheels:
    """Wheels whose constant errors alone make a drift between 2.8 and 3.8 % on a route; chance adds to it.

    The errors are linear in the drift, so that those of a drift of 1 give the scale.
    """
    sign = float(rng.choice([-1.0, 1.0]))
    size = float(rng.uniform(0.028, 0.038)) / drift_of(route, sign * YAW_ERROR_PER_M, SCALE_ERROR)
    wheel_error = 0.5 * sign * size * YAW_ERROR_PER_M * BASE_M
    return Wheels(
        radius_m=0.1,
        base_m=BASE_M,
        left_radius_error=-wheel_error,
        right_radius_error=wheel_error,
        base_error=float(rng.uniform(-0.001, 0.001)),
        slip_mean=size * SCALE_ERROR,
        slip_deviation=0.0003,
        grip_losses=GripLosses(per_km=4.0, both_wheels_m=0.4, one_wheel_m=0.009),
        max_speed_mps=2.5,
    )


def drift_of(route: Sequence[XY], yaw_error_per_m: float, scale_error: float) -> float:
    """Drift along a polyline of small constant errors of yaw and scale: mean relative error over all stretches of 100 m.

    To first order the error of a stretch is the integral of `scale_error` along the path and of the accumulated yaw error
    across it.
    """
    corners = np.array(route)
    ends = cumulative_distance(corners)
    s = np.arange(0.0, ends[-1], SAMPLE_M)
    points = np.column_stack([np.interp(s, ends, corners[:, 0]), np.interp(s, ends, corners[:, 1])])
    stretch = min(round(STRETCH_M / SAMPLE_M), len(s) - 1)
    moments = np.cumsum((s * SAMPLE_M)[:, None] * np.gradient(points, SAMPLE_M, axis=0), axis=0)
    span = points[stretch:] - points[:-stretch]
    across = moments[stretch:] - moments[:-stretch] - s[:-stretch, None] * span
    error = scale_error * span + yaw_error_per_m * np.column_stack([-across[:, 1], across[:, 0]])
    return float(np.hypot(error[:, 0], error[:, 1]).mean() / (stretch * SAMPLE_M))
