"""A log of two laps through a ring of corridors with niches, by plain geometry: rays against segments, noise of its own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry

Floats = NDArray[np.float64]

BEAMS = 180
PERIOD_NS = 200_000_000
STEP_M = 0.15


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


WALLS = np.array(
    box(-1.0, -1.0, 13.0, 8.0)
    + box(1.0, 1.0, 11.0, 6.0)
    + box(3.0, -1.0, 3.6, -0.6)
    + box(7.0, 0.7, 7.5, 1.0)
    + box(12.6, 3.0, 13.0, 3.7)
    + box(8.0, 7.5, 9.1, 8.0)
    + box(2.0, 6.0, 2.4, 6.3)
    + box(-1.0, 4.0, -0.6, 4.4)
)


def path(laps: int) -> Floats:
    """Poses `(n, 3)` along a rounded rectangle, some centimetres from scan to scan."""
    corners = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 7.0], [0.0, 7.0]])
    poses = [np.zeros(3)]
    for leg in range(4 * laps):
        path = corners[(leg + 1) % 4] - corners[leg % 4]
        heading = float(np.arctan2(path[1], path[0]))
        rotation = float(se2.wrap_angle(heading - poses[-1][2]))
        for _ in range(int(np.ceil(abs(rotation) / 0.15))):
            poses.append(poses[-1] + [0.0, 0.0, rotation / np.ceil(abs(rotation) / 0.15)])
        length = float(np.hypot(*path))
        for k in range(1, round(length / STEP_M) + 1):
            xy = corners[leg % 4] + path * min(k * STEP_M / length, 1.0)
            poses.append(np.array([xy[0], xy[1], poses[-1][2]]))
    return np.array(poses)


def ranges_from(pose: Floats, angles: Floats) -> Floats:
    """Distance to the nearest wall along each angle of the robot's frame."""
    bearing = pose[2] + angles
    dx, dy = np.cos(bearing)[:, None], np.sin(bearing)[:, None]
    ax, ay = WALLS[:, 0] - pose[0], WALLS[:, 1] - pose[1]
    ex, ey = WALLS[:, 2] - WALLS[:, 0], WALLS[:, 3] - WALLS[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        along = (ax * ey - ay * ex) / cross
        across = (ax * dy - ay * dx) / cross
        hit = (along > 0.0) & (across >= 0.0) & (across <= 1.0)
    return np.where(hit, along, np.inf).min(axis=1)


def events(laps: int = 2, seed: int = 0, extrinsics_yaw_rad: float = 0.0) -> Iterator[Event]:
    """Odometry with a bias of the heading and slip, and scans with noise, drop-outs and a few wrong readings."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    truth = path(laps)
    odometry = np.zeros(3)
    for k, pose in enumerate(truth):
        if k:
            step = se2.between(truth[k - 1], pose)
            rotation = step[2] * 1.02 + 0.0015 + rng.normal(0.0, 0.002)
            odometry = se2.compose(odometry, [step[0] * 1.01 + rng.normal(0.0, 0.003), 0.0, rotation])
        stamp = 1_000_000_000 + k * PERIOD_NS
        yield Odometry(stamp, "odom", *(float(v) for v in odometry))
        ranges = ranges_from(pose, angles + extrinsics_yaw_rad) + rng.laplace(0.0, 0.008, BEAMS)
        ranges[rng.random(BEAMS) < 0.02] = np.inf
        wrong = rng.random(BEAMS) < 0.01
        ranges[wrong] *= rng.uniform(0.3, 1.0, int(wrong.sum()))
        yield LaserScan(stamp, "laser", ranges.astype(np.float32), -np.pi, 2 * np.pi / BEAMS, 0.05, 30.0)
