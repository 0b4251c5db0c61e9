"""CPU time of localization along half an hour of a lidar at 10 Hz, through a place whose map others made.

The scans are cast into the map: it is the speed that is measured here, of a filter that has found its pose.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, readonly
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.sensors.likelihood_field import occupied_cells
from gridslam.sensors.range_caster import range_caster
from tests.benchmarks.bench_ispace_maps import route_through
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.real_places import data_dir

Floats = NDArray[np.float64]

PLACE, MINUTES, RATE_HZ = "depot", 30.0, 10.0
BEAMS, MAX_RANGE_M, RANGE_STD_M = 360, 12.0, 0.02
SPEED_MPS, YAW_RATE_RADPS = 0.5, 0.8
SCALE_ERROR, YAW_STD_PER_STEP = 0.01, 0.001  # of the odometry: m/m, rad


def rows() -> Iterator[BenchmarkRow]:
    """How many times faster than the log its localization is, in CPU time, and the errors at its end."""
    folder = data_dir()
    if folder is None:
        return
    grid = load_any_map(folder / "maps" / f"{PLACE}.yaml")
    truth = path_through(grid, np.random.default_rng(0))
    events = events_along(grid, truth, np.random.default_rng(1))
    method = IspaceMcl(IspaceMclConfig(), 0, grid)
    started = time.process_time()
    for event in events:
        method.process(event)
    result = method.result()
    cost_s = time.process_time() - started
    off_m = np.hypot(*(result.trajectory.poses[:, :2] - truth[-len(result.trajectory) :, :2]).T)
    converged_s = cost_s - result.timings_s["odometry_check"]  # which is done once, at the start
    yield BenchmarkRow("ispace.realtime.factor", len(truth) / RATE_HZ / converged_s, "x")
    yield BenchmarkRow("ispace.realtime.scan", 1e3 * cost_s / len(truth), "ms")
    yield BenchmarkRow("ispace.realtime.off", float(np.percentile(off_m, 95)), "m")
    for stage, seconds in result.timings_s.items():
        yield BenchmarkRow(f"ispace.realtime.{stage}", seconds, "s")


def path_through(grid: OccupancyGrid, rng: np.random.Generator) -> Floats:
    """Poses `(n, 3)` at every scan of a robot that drives from one waypoint to the next, and turns there."""
    count = int(MINUTES * 60.0 * RATE_HZ)
    route = route_through(grid, MINUTES * 60.0 * SPEED_MPS, rng)
    poses: list[Floats] = []
    yaw = 0.0
    for start, end in pairwise(route):
        heading = float(np.arctan2(*(end - start)[::-1]))
        rotation = float(se2.wrap_angle(heading - yaw))
        turned = np.arange(0.0, abs(rotation), YAW_RATE_RADPS / RATE_HZ)
        poses += [np.r_[start, yaw + np.sign(rotation) * angle] for angle in turned]
        length = float(np.hypot(*(end - start)))
        driven = np.arange(0.0, length, SPEED_MPS / RATE_HZ) / length
        poses += [np.r_[start + part * (end - start), heading] for part in driven]
        yaw = heading
    path = np.array(poses[:count])
    path[:, 2] = se2.wrap_angle(path[:, 2])
    return path


def events_along(grid: OccupancyGrid, truth: Floats, rng: np.random.Generator) -> list[Event]:
    """A scan and odometry for each of the poses `(n, 3)`."""
    caster = range_caster(occupied_cells(grid, 0.65), grid.geometry)
    bearings = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    ranges = caster.ranges(truth, bearings, np.zeros(3), MAX_RANGE_M)
    noisy = np.where(ranges < MAX_RANGE_M, ranges + rng.normal(0.0, RANGE_STD_M, ranges.shape), np.inf)
    odometry, events = np.zeros(3), []
    for k, pose in enumerate(truth):
        if k:
            step = se2.between(truth[k - 1], pose) * (1.0 + SCALE_ERROR, 1.0, 1.0)
            step[2] += rng.normal(0.0, YAW_STD_PER_STEP)
            odometry = se2.compose(odometry, step)
        stamp_ns = round((k + 1) / RATE_HZ * 1e9)
        x, y, yaw = odometry.tolist()
        events.append(Odometry(stamp_ns, "odom", x, y, yaw))
        events.append(
            LaserScan(
                stamp_ns=stamp_ns,
                frame_id="lidar",
                angle_min_rad=-np.pi,
                angle_increment_rad=2.0 * np.pi / BEAMS,
                range_min_m=0.05,
                range_max_m=MAX_RANGE_M,
                ranges_m=readonly(noisy[k], np.float32),
            )
        )
    return events
