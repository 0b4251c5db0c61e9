"""The robot that travels through a place: lidar, odometry and their errors, drawn by seed.

The odometry's drift is 2 to 5 %: the mean relative error of position over all stretches of 100 m, as a fraction of their length.
Wheels of unequal radii and slip that lasts turn the heading, a constant slip shortens the path, and now and then wheels spin.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridslam.simulation.places.config import Kind
from gridslam.simulation.robot_config import GripLosses, Wheels
from gridslam.simulation.sensor_config import Lidar, Mounting, WheelOdometry
from gridslam.simulation.sensor_suite import Sensors


class Scanner(NamedTuple):
    """A make of lidar."""

    beams: int
    field_of_view_deg: float
    range_max_m: float
    noise_m: float
    resolution_m: float


INDOORS = (
    Scanner(181, 180.0, 8.0, 0.012, 0.01),
    Scanner(360, 360.0, 12.0, 0.02, 0.01),
    Scanner(271, 270.0, 25.0, 0.015, 0.001),
    Scanner(541, 270.0, 30.0, 0.012, 0.001),
    Scanner(181, 180.0, 80.0, 0.02, 0.01),
)
OUTDOORS = (
    Scanner(361, 180.0, 80.0, 0.02, 0.01),
    Scanner(541, 270.0, 30.0, 0.015, 0.001),
    Scanner(541, 270.0, 50.0, 0.02, 0.001),
    Scanner(720, 360.0, 60.0, 0.02, 0.005),
)
WINDING = 1.4  # errors that make the same drift where 100 m of path end 40 m away
SCAN_RATES_HZ = (2.5, 4.0, 5.0, 6.0)


def sensors(kind: Kind, rng: np.random.Generator) -> Sensors:
    """A lidar that loses readings and reads wildly now and then, and odometry from encoders."""
    makes = OUTDOORS if kind == "campus" else INDOORS
    make = makes[int(rng.integers(len(makes)))]
    rate = float(rng.choice(SCAN_RATES_HZ))
    lidar = Lidar(
        mounting=Mounting(x=round(float(rng.uniform(0.0, 0.25)), 3), z=0.3),
        **make._asdict(),
        rate_hz=rate,
        sweep_s=float(rng.choice([0.025, 0.05, 0.1])),
        latency_s=0.005,
        jitter_s=0.002,
        missing=0.003,
        dropout=round(float(rng.uniform(0.003, 0.03)), 4),
        stray=round(float(rng.uniform(0.0005, 0.004)), 5),
    )
    return Sensors(lidar=lidar, odometry=WheelOdometry(rate_hz=12.5, jitter_s=0.001, missing=0.002))


def wheels(kind: Kind, rng: np.random.Generator) -> Wheels:
    """Errors in proportion to a drift drawn between 3 and 4.2 %, of either sign; chance adds the rest."""
    drift = float(rng.uniform(0.03, 0.042)) * (WINDING if kind == "office" else 1.0)
    base_m = 0.45
    yaw_per_m = 0.9 * drift * 2.0 / 100.0 * float(rng.choice([-1.0, 1.0]))
    return Wheels(
        radius_m=0.1,
        base_m=base_m,
        left_radius_error=-0.5 * yaw_per_m * base_m,
        right_radius_error=0.5 * yaw_per_m * base_m,
        base_error=float(rng.uniform(-0.004, 0.004)),
        slip_mean=0.3 * drift,
        slip_deviation=0.015 * drift,
        grip_losses=GripLosses(per_km=4.0, both_wheels_m=0.4, one_wheel_m=0.5 * drift),
        max_speed_mps=2.5,
    )
