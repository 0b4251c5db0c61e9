"""The simulator: time for ten minutes of lidar, and drift of the odometry over six laps."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import Odometry
from gridslam.core.random import random_stream
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.geometry import radians
from gridslam.simulation.record import record_world
from gridslam.simulation.sensors.camera_config import RgbdCamera
from gridslam.simulation.sensors.cameras import CameraSensor
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import load_world
from tests.benchmarks.harness import BenchmarkRow

ALONE = True

SEEDS = 20
LIDAR = ("sensors.lidar.rate_hz=10", "sensors.lidar.beams=360", "sensors.lidar.field_of_view_deg=360")


def rows() -> Iterator[BenchmarkRow]:
    """Speed including writing the log; mean, deviation and maximum of the drift over 20 seeds."""
    yield BenchmarkRow("simulation.lidar.ten_minutes", seconds_for_ten_minutes(), "s", bound=30.0)
    yield BenchmarkRow("simulation.rgbd.frames", rgbd_frames_per_second(), "1/s", bound=5.0, at_least=True)
    drifts = np.array([final_drift(seed) for seed in range(SEEDS)])
    yield BenchmarkRow("simulation.ir_laps.drift.mean", float(drifts.mean()), "m")
    yield BenchmarkRow("simulation.ir_laps.drift.deviation", float(drifts.std()), "m")
    yield BenchmarkRow("simulation.ir_laps.drift.largest", float(drifts.max()), "m")


def seconds_for_ten_minutes() -> float:
    """Wall time (s) for 600 s with 10 scans per second of 360 beams in the office, including writing."""
    world, path = load_world("office", LIDAR)
    with tempfile.TemporaryDirectory() as folder:
        record_world(load_world("ir-room")[0], path.parent, Path(folder) / "warm_up.mcap")
        started = time.perf_counter()
        done = record_world(world, path.parent, Path(folder) / "log.mcap")
        return (time.perf_counter() - started) * 600.0 / done.duration_s


def final_drift(seed: int) -> float:
    """Distance (m) between the final odometry pose and the true one after six laps of the infrared world."""
    world, path = load_world("ir-laps", ("sensors.gyro=null",), seed)
    simulator = Simulator(world, path.parent)
    odometry = [e for e, is_truth in drive_route(simulator) if isinstance(e, Odometry) and not is_truth]
    believed = se2.compose(radians(world.robot.start), odometry[-1].pose)
    return float(np.hypot(*(believed - simulator.robot.pose)[:2]))


def rgbd_frames_per_second(frames: int = 20) -> float:
    """Colour and depth of 640 x 480 pixels in the corridor with people."""
    world, path = load_world("ispace-corridor")
    config = RgbdCamera(name="camera", width_px=640, height_px=480, focal_px=560.0, rate_hz=100.0)
    camera = CameraSensor(config, world.start_ns, random_stream(0, "camera"), path.parent, is_fixed=False)
    simulator = Simulator(world, path.parent)
    camera.poll(0, simulator.robot, simulator.scene)
    started = time.perf_counter()
    for k in range(1, frames + 1):
        assert camera.poll(k * 10_000_000, simulator.robot, simulator.scene)
    return frames / (time.perf_counter() - started)
