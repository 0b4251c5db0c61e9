"""Explores a simulated world with the help of a drawing, and maps it.

The recorded log is read in the order in which the estimator received its events, so mapping it again gives the same map.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Odometry
from gridslam.core.plain_files import sha256_of
from gridslam.core.trajectory import Trajectory
from gridslam.kernels.compiling import timing_compilation
from gridslam.logs.write import open_writer
from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.methods.registry import MethodEntry
from gridslam.planning.dwa import DifferentialDrive
from gridslam.runs.closed_loop import ClosedLoop, Ending, Explores
from gridslam.runs.feed import Progress, Show, Stop
from gridslam.runs.inputs import Input, refuse_missing_inputs, refuse_unknown_inputs
from gridslam.runs.run import Run, method_builder, status_of
from gridslam.runs.run_config import RunConfig
from gridslam.runs.run_counts import merge_counts
from gridslam.simulation.record import write_truth
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig

MAX_YAW_RATE_RADPS = 10.0
LOG_NAME, TRUTH_NAME = "log.mcap", "truth"


@dataclass(frozen=True, slots=True)
class Explored:
    """A finished exploration: the run, as `map` would make it of the recorded log, and how it ended."""

    run: Run
    ended: Ending
    duration_s: float
    travelled_m: float
    clearance_m: float


def explore(
    config: RunConfig[BaseModel],
    world: WorldConfig,
    world_path: Path,
    inputs: Mapping[str, Input],
    folder: Path,
    show: Show,
    stop: Stop,
    max_duration_s: float | None = None,
) -> Explored:
    """Explore a world, and write `log.mcap` and `truth/` to a folder.

    config: Method and settings.
    world, world_path: The world and its file.
    inputs: The method's inputs, among them the drawing.
    show: Called with the progress.
    stop: Called in every period; the exploration ends once it returns true.
    max_duration_s: Longest time in the world, if it is below the world's own.

    Raises ConfigError if the method does not explore or lacks its drawing, or if the world has no lidar or odometry.
    """
    entry = _checked(config, world, inputs)
    with timing_compilation() as clock:
        started = clock.now()
        simulator = Simulator(world, world_path.parent)
        grid = true_map(simulator.scene, world.truth)
        method, explorer = _built(entry, config, world, inputs)
        limit_s, limit = _limit(world, max_duration_s)
        log_path = folder / LOG_NAME
        loop = ClosedLoop(simulator, method, explorer, show=show, limit_s=limit_s, now=clock.now)
        with open_writer(log_path, force=False) as writer:
            loop.drive(writer.write, writer.write_truth, stop)
        before_result = clock.now()
        show(Progress(loop.events, loop.events, loop.scans, is_finishing=True))
        result = _with_ending(explorer.add_to(method.result()), loop)
        write_truth(folder / TRUTH_NAME, world, simulator.scene, loop.path, grid)
        finished = clock.now()
        run = Run(
            command="explore",
            config=config,
            log_path=Path(LOG_NAME),
            inputs=_hashes(inputs, (world_path, log_path)),
            result=result,
            occupancy=result.occupancy,
            truth=_trajectory(loop.path),
            status=status_of(result, is_interrupted=loop.ended == "interrupted", is_lossy=False),
            is_lossy=False,
            problems=_problems(loop, limit),
            counts=merge_counts(loop.counts, result.counters),
            read_s=before_result - started - loop.process_s,
            process_s=loop.process_s + finished - before_result,
            compile_s=clock.seconds,
            given={name: item.path.name for name, item in inputs.items()},
        )
        robot, watch = simulator.robot, loop.watch
        return Explored(run, loop.ended, simulator.time_s, robot.distance_m, watch.clearance_m)


def drive_of(world: WorldConfig) -> DifferentialDrive:
    """The drive of the world's robot."""
    wheels = world.robot.wheels
    return DifferentialDrive(
        radius_m=world.robot.radius_m,
        base_m=wheels.base_m,
        acceleration_mps2=wheels.acceleration_mps2,
        max_speed_mps=wheels.max_speed_mps,
        max_yaw_rate_radps=MAX_YAW_RATE_RADPS,
    )


def _checked(config: RunConfig[BaseModel], world: WorldConfig, inputs: Mapping[str, Input]) -> MethodEntry:
    name = config.method_name
    entry = registry.METHODS[name]
    if not entry.explorer:
        explorers = [n for n, e in registry.METHODS.items() if e.explorer]
        raise ConfigError(f"method.name: {name} cannot explore; methods that can: {', '.join(explorers)}")
    refuse_unknown_inputs(name, inputs)
    refuse_missing_inputs(name, inputs)
    if world.sensors.lidar is None:
        raise ConfigError("sensors.lidar: this world's robot has no lidar; exploring needs one")
    if world.sensors.odometry is None or not world.sensors.odometry.publish_odometry:
        raise ConfigError("sensors.odometry: this world's robot publishes no odometry; exploring needs it")
    return entry


def _built(
    entry: MethodEntry, config: RunConfig[BaseModel], world: WorldConfig, inputs: Mapping[str, Input]
) -> tuple[Method, Explores]:
    """The method, and the part of it that drives the world's robot."""
    values = {name: item.value for name, item in inputs.items()}
    method = method_builder("map", config)(config.method, config.seed, **values)
    return method, registry.load(entry.explorer)(method, config.method, drive_of(world), config.seed)


def _limit(world: WorldConfig, max_duration_s: float | None) -> tuple[float, str]:
    """The longest time (s) in the world, and what sets it."""
    given_s = np.inf if max_duration_s is None else max_duration_s
    return min((world.max_duration_s, "max_duration_s of the world"), (given_s, "--longest"))


def _hashes(inputs: Mapping[str, Input], files: Iterable[Path]) -> dict[str, str]:
    """SHA-256 of the inputs and of further files, by name."""
    return {item.path.name: item.sha256 for item in inputs.values()} | {
        path.name: sha256_of(path) for path in files
    }


def _trajectory(path: list[Odometry]) -> Trajectory:
    stamps = np.array([pose.stamp_ns for pose in path], np.int64)
    return Trajectory(stamps, np.array([pose.pose for pose in path]).reshape(-1, 3))


def _with_ending(result: RunResult, loop: ClosedLoop) -> RunResult:
    """The result whose measures have the ending, duration, distance and clearance of the exploration."""
    exploration = result.measures.get("exploration")
    simulator = loop.simulator
    ending: dict[str, object] = {
        "ended": loop.ended,
        "duration_s": round(simulator.time_s, 2),
        "travelled_m": round(simulator.robot.distance_m, 2),
        "min_clearance_m": round(float(loop.watch.clearance_m), 3),
    }
    known = exploration if isinstance(exploration, dict) else {}
    return replace(result, measures={**result.measures, "exploration": {**ending, **known}})


def _problems(loop: ClosedLoop, limit: str) -> tuple[str, ...]:
    """A message if the exploration did not finish."""
    simulator = loop.simulator
    if loop.ended == "contact":
        x, y = simulator.robot.x, simulator.robot.y
        return (
            f"the robot touched something at ({x:.2f}, {y:.2f}) after {simulator.time_s:.0f} s and stopped there",
        )
    if loop.ended == "time":
        return (f"not finished after {simulator.time_s:.0f} s, the time limit; raise {limit}",)
    return ()
