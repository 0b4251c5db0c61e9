"""A room of 3 x 2 m with a box and two pillars, and the scans of three rangers in it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Imu, Odometry, Range, Transform
from gridslam.sensors.infrared import InfraredScan
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]

CORNERS = [(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)]
PILLARS = [[(x, 0.0), (x + 0.2, 0.0), (x + 0.2, 0.15), (x, 0.15)] for x in (0.9, 1.9)]
BOX = [(1.3, 1.2), (1.7, 1.2), (1.7, 1.6), (1.3, 1.6)]
NAMES = ("front", "left", "right")
EXTRINSICS = (
    LidarExtrinsics(np.array([0.1, 0.0, 0.0])),
    LidarExtrinsics(np.array([0.0, 0.08, math.pi / 2])),
    LidarExtrinsics(np.array([0.0, -0.08, -math.pi / 2])),
)
LIMITS = ((0.2, 1.5), (0.1, 0.8), (0.1, 0.8))
BEARINGS = np.radians(np.arange(-60.0, 61.0, 2.0))
STOPS = np.array([(0.5 + 0.25 * k, 0.6, 0.0) for k in range(9)])


def walls(corners: list[tuple[float, float]]) -> Floats:
    """Segments `(n, 4)` of a closed polygon."""
    return np.array([[*a, *b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])


SEGMENTS = np.concatenate([walls(CORNERS), walls(BOX), *map(walls, PILLARS)])


def distance(origin: Floats, angle: float, segments: Floats = SEGMENTS) -> float:
    """Distance to the nearest segment along a ray; infinite without one."""
    c, s = math.cos(angle), math.sin(angle)
    nearest = math.inf
    for x0, y0, x1, y1 in segments:
        cross = c * (y1 - y0) - s * (x1 - x0)
        if abs(cross) < 1e-12:
            continue
        t = ((x0 - origin[0]) * (y1 - y0) - (y0 - origin[1]) * (x1 - x0)) / cross
        u = ((x0 - origin[0]) * s - (y0 - origin[1]) * c) / cross
        if t > 0.0 and 0.0 <= u <= 1.0:
            nearest = min(nearest, t)
    return nearest


def scan_from(
    pose: Floats, rng: np.random.Generator, noise_m: float = 0.0, segments: Floats = SEGMENTS
) -> InfraredScan:
    """The scan at a true pose."""
    columns = []
    for k, (extrinsics, limits) in enumerate(zip(EXTRINSICS, LIMITS, strict=True)):
        sensor = se2.compose(pose, extrinsics.pose)
        for bearing in BEARINGS.tolist():
            value = distance(sensor[:2], sensor[2] + bearing, segments) + noise_m * rng.standard_normal()
            columns.append((k, bearing, value, *limits))
    sensor_of, bearing, value, low, high = np.array(columns).T
    return InfraredScan(0, NAMES, EXTRINSICS, sensor_of.astype(np.int64), bearing, value, low, high)


def events(
    stops: Floats = STOPS, noise_m: float = 0.005, with_gyro: bool = True, seed: int = 0
) -> Iterator[Event]:
    """A log of a robot that stands, sweeps and drives straight to the next stop; its odometry is 2 % too long."""
    rng = np.random.default_rng(seed)
    for name, extrinsics in zip(NAMES, EXTRINSICS, strict=True):
        half = 0.5 * extrinsics.pose[2]
        where = (float(extrinsics.pose[0]), float(extrinsics.pose[1]), 0.0)
        yield Transform(0, "base_link", name, where, (math.cos(half), 0.0, 0.0, math.sin(half)), True)
    tick, odometry = 0, np.zeros(3)
    for k, stop in enumerate(stops):
        scan = scan_from(stop, rng, noise_m)
        for i in range(len(BEARINGS)):
            tick += 1
            stamp = tick * 20_000_000
            for j, name in enumerate(NAMES):
                row = j * len(BEARINGS) + i
                low, high = scan.range_min_m[row], scan.range_max_m[row]
                yield Range(
                    stamp,
                    name,
                    float(scan.bearing_rad[row]),
                    float(scan.range_m[row]),
                    float(low),
                    float(high),
                )
            yield Odometry(stamp + 1, "odom", *odometry.tolist())
            if with_gyro:
                yield Imu(stamp + 2, "imu", 0.003 * rng.standard_normal())
        if k + 1 < len(stops):
            step = se2.between(stop, stops[k + 1]) / 20.0
            for _ in range(20):
                tick += 1
                odometry = se2.compose(odometry, step * np.array([1.02, 1.02, 1.0]))
                yield Odometry(tick * 20_000_000, "odom", *odometry.tolist())
                if with_gyro:
                    yield Imu(tick * 20_000_000 + 2, "imu", step[2] / 0.02 + 0.003 * rng.standard_normal())
