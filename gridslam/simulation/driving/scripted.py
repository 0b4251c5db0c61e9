"""A scripted log: a robot drives around a block inside a hall, with ranges computed in closed form.

It needs neither a world file nor a renderer; the kernels are warmed up on its events.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import (
    AbsolutePose,
    Disparity,
    Event,
    LaserScan,
    Odometry,
    Range,
    Transform,
    as_float32,
    canonical_yaw,
    readonly,
)
from gridslam.core.random import random_stream
from gridslam.maps.drawings.drawing import RESOLUTION_M, Drawing

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 100_000_000
SPEED_M = 0.06  # travel per period
ROTATION_RAD = 0.08  # rotation per period
RANGE_MAX_M = 20.0
LASER_X_M = 0.1
SWEEP_EVERY = 20  # periods between sweeps of the infrared ranger, which looks ahead: they overlap
PICTURE_EVERY = 60  # periods between stereo pictures, each with an absolute pose
RANGER_LIMITS_M = 0.2, 5.0
POSE_COVARIANCE = readonly(np.diag([0.02, 0.02, 0.02]) ** 2, np.float64)
STEREO_PX = 40, 80  # rows, columns of a small disparity image
STEREO_FOCAL_PX, STEREO_BASELINE_M = 70.0, 0.12
OPTICAL = (0.5, -0.5, 0.5, -0.5)  # orientation (w, x, y, z) of a camera that looks ahead

Rectangle = tuple[float, float, float, float]
HALL: Rectangle = (0.0, 0.0, 14.0, 9.0)  # x0, y0, x1, y1
BLOCKS: tuple[Rectangle, ...] = (
    (4.0, 3.0, 10.0, 6.0),  # what the robot drives around
    (0.0, 4.0, 0.6, 5.2),
    (12.4, 0.0, 14.0, 0.7),
    (7.0, 8.4, 8.1, 9.0),
    (3.2, 0.0, 3.5, 0.5),
    (13.3, 6.1, 14.0, 6.5),
)
ROUTE: tuple[tuple[float, float], ...] = ((2.0, 1.5), (12.0, 1.5), (12.0, 7.5), (2.0, 7.5))


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation of a range (m), of odometry (as a fraction of the motion), and odometry's systematic errors.

    In the periods `frozen` odometry stays where it is, and then catches up, as in recorded logs.
    """

    range_m: float = 0.01
    translation: float = 0.05
    rotation: float = 0.05
    scale: float = 1.01
    drift_rad: float = 0.0006  # per period
    frozen: range = range(0)


def walls() -> NDArray[np.float64]:
    """Wall segments `(n, 4)`: x0, y0, x1, y1 in metres."""
    sides = [
        side
        for x0, y0, x1, y1 in (HALL, *BLOCKS)
        for side in ((x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0))
    ]
    return np.array(sides)


def scripted_drawing() -> Drawing:
    """The hall and its blocks drawn one pixel wide, with a margin of a metre."""
    margin, step = 1.0, RESOLUTION_M
    rows, cols = (round((extent + 2.0 * margin) / step) for extent in (HALL[3], HALL[2]))
    levels = np.full((rows, cols), 255, np.uint8)
    for x0, y0, x1, y1 in walls():
        count = int(np.hypot(x1 - x0, y1 - y0) / (0.5 * step)) + 1
        xs, ys = np.linspace(x0, x1, count), np.linspace(y0, y1, count)
        levels[((ys + margin) / step).astype(np.int64), ((xs + margin) / step).astype(np.int64)] = 0
    return Drawing(levels, "scripted")


def true_path(laps: int = 2) -> NDArray[np.float64]:
    """True poses `(n, 3)`, one per period: straight along the route, turning on the spot at its corners."""
    corners = np.array(ROUTE * laps + ROUTE[:1])
    pieces = []
    for start, end, after in zip(corners, corners[1:], [*corners[2:], corners[-1]], strict=False):
        side = end - start
        yaw = float(np.arctan2(side[1], side[0]))
        steps = round(float(np.hypot(*side)) / SPEED_M)
        along = start + np.arange(steps)[:, None] / steps * side
        pieces.append(np.column_stack([along, np.full(steps, yaw)]))
        rotation = (
            float(se2.wrap_angle(np.arctan2(*(after - end)[::-1]) - yaw)) if (after != end).any() else 0.0
        )
        n = max(round(abs(rotation) / ROTATION_RAD), 1)
        pieces.append(
            np.column_stack([np.tile(end, (n, 1)), se2.wrap_angle(yaw + np.arange(n) / n * rotation)])
        )
    return np.concatenate(pieces)


def ranges_from(pose: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exact distances `(m,)` (m) to the nearest wall along bearings `(m,)` (rad) from a laser pose `(3,)`."""
    x0, y0, x1, y1 = walls().T[:, None, :]
    cos, sin = np.cos(pose[2] + bearings)[:, None], np.sin(pose[2] + bearings)[:, None]
    dx, dy, ox, oy = x1 - x0, y1 - y0, x0 - pose[0], y0 - pose[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = cos * dy - sin * dx
        distance = (ox * dy - oy * dx) / cross
        along_wall = (ox * sin - oy * cos) / cross
    hit = (distance > 0) & (along_wall >= 0) & (along_wall <= 1)
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))


def scripted_log(
    laps: int = 2, beams: int = 180, seed: int = 0, noise: Noise | None = None
) -> Iterator[tuple[Event, Odometry | None]]:
    """Events in order, each odometry with the true pose at its stamp; static transforms come first."""
    noise = noise or Noise()
    rng = random_stream(seed, "scripted log")
    bearings = np.linspace(-np.pi / 2, np.pi / 2, beams)
    yield (
        Transform(
            START_NS,
            "base_link",
            child_frame_id="laser",
            translation_m=(LASER_X_M, 0.0, 0.0),
            quat_wxyz=(1.0, 0.0, 0.0, 0.0),
            is_static=True,
        ),
        None,
    )
    yield (
        Transform(
            START_NS,
            "base_link",
            child_frame_id="stereo_optical",
            translation_m=(0.0, 0.0, 0.5),
            quat_wxyz=OPTICAL,
            is_static=True,
        ),
        None,
    )
    estimate, reported, before = np.zeros(3), np.zeros(3), None
    for k, pose in enumerate(true_path(laps)):
        stamp = START_NS + k * PERIOD_NS
        if before is not None:
            step = se2.between(before, pose)
            step[0] *= noise.scale + noise.translation * rng.standard_normal()
            step[2] = step[2] * (1 + noise.rotation * rng.standard_normal()) + noise.drift_rad
            estimate = se2.compose(estimate, step)
        before = pose
        if k not in noise.frozen:
            reported = estimate
        yield _odometry(stamp, "odom", reported), _odometry(stamp, "map", pose)
        exact = ranges_from(se2.compose(pose, [LASER_X_M, 0.0, 0.0]), bearings)
        ranges = exact + noise.range_m * rng.standard_normal(beams)
        yield _scan(stamp, bearings, ranges), None
        if k % SWEEP_EVERY == 0:
            yield from ((reading, None) for reading in _sweep(stamp, pose, noise, rng))
        if k % PICTURE_EVERY == 0:
            yield AbsolutePose(stamp, "map", pose, POSE_COVARIANCE), None
            yield _disparity(stamp, pose), None


def _sweep(
    stamp_ns: int, pose: NDArray[np.float64], noise: Noise, rng: np.random.Generator
) -> Iterator[Range]:
    """A sweep of the ranger within one period, as if the robot stood."""
    bearings = np.radians(np.arange(-60.0, 61.0, 2.0))
    ranges = ranges_from(pose, bearings) + noise.range_m * rng.standard_normal(len(bearings))
    limits = tuple(map(as_float32, RANGER_LIMITS_M))
    for k, (bearing, value) in enumerate(zip(bearings.tolist(), ranges.tolist(), strict=True)):
        yield Range(
            stamp_ns + (k + 1) * 1_000_000,
            "ranger",
            bearing_rad=bearing,
            range_m=as_float32(value),
            range_min_m=limits[0],
            range_max_m=limits[1],
        )


def _disparity(stamp_ns: int, pose: NDArray[np.float64]) -> Disparity:
    """Disparities of the walls before a stereo head that looks ahead; there is no floor."""
    rows, cols = STEREO_PX
    x = (np.arange(cols) - 0.5 * (cols - 1)) / STEREO_FOCAL_PX
    depths = ranges_from(pose, -np.arctan(x)) * np.cos(np.arctan(x))
    disparity = np.tile(STEREO_FOCAL_PX * STEREO_BASELINE_M / depths, (rows, 1))
    return Disparity(
        stamp_ns,
        "stereo_optical",
        disparity_px=readonly(disparity, np.float32),
        focal_px=STEREO_FOCAL_PX,
        baseline_m=STEREO_BASELINE_M,
        camera="stereo",
    )


def _odometry(stamp_ns: int, frame: str, pose: NDArray[np.float64]) -> Odometry:
    return Odometry(stamp_ns, frame, float(pose[0]), float(pose[1]), canonical_yaw(float(pose[2])))


def _scan(stamp_ns: int, bearings: NDArray[np.float64], ranges: NDArray[np.float64]) -> LaserScan:
    step = float(np.float32(bearings[1] - bearings[0]))
    return LaserScan(
        stamp_ns,
        "laser",
        ranges_m=readonly(ranges, np.float32),
        angle_min_rad=float(np.float32(bearings[0])),
        angle_increment_rad=step,
        range_min_m=0.05,
        range_max_m=RANGE_MAX_M,
    )
