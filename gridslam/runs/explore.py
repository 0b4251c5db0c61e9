"""The closed loop of simulator, estimator and explorer: a drawing in, a finished map out.

The estimator receives the events in the order of their stamps, slightly delayed. A recorded log is read in the same order, so
mapping it again gives the same map.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from pydantic import BaseModel

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.core.plain_files import sha256_of
from gridslam.core.trajectory import Trajectory
from gridslam.kernels.compiling import timing_compilation
from gridslam.logs.write import open_writer
from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.methods.registry import MethodEntry
from gridslam.planning.dwa import DifferentialDrive
from gridslam.runs.run import (
    Clock,
    Input,
    Progress,
    Run,
    Show,
    Stop,
    method_builder,
    refuse_unknown_inputs,
    status_of,
)
from gridslam.runs.run_config import RunConfig
from gridslam.runs.run_counts import merge_counts
from gridslam.simulation.contact import ContactWatch
from gridslam.simulation.record import write_truth
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig

STEPS_PER_COMMAND = 10  # of 10 ms
MAX_DELAY_NS = 250_000_000  # of a message after its stamp
MAX_YAW_RATE_RADPS = 10.0
LOG_NAME, TRUTH_NAME = "log.mcap", "truth"

Ending = Literal["finished", "contact", "time", "interrupted"]


class WheelCommand(Protocol):
    """Speeds of the wheels along the ground."""

    @property
    def left_mps(self) -> float: ...
    @property
    def right_mps(self) -> float: ...


class Explores(Protocol):
    """The part of a method that drives the robot."""

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to observe."""

    def add(self, event: Event) -> None:
        """Process an event as it arrives."""

    def command(self) -> WheelCommand:
        """Wheel speeds for the next period."""

    def add_to(self, result: RunResult) -> RunResult:
        """The estimator's result with those of the exploration."""


@dataclass(frozen=True, slots=True)
class Explored:
    """A finished exploration: the run, as `map` would make it of the recorded log, and how it ended."""

    run: Run
    ended: Ending
    duration_s: float
    travelled_m: float
    clearance_m: float


class InStampOrder:
    """Releases events in the order of their stamps, a fixed delay after them."""

    def __init__(self, delay_ns: int) -> None:
        self._delay_ns = delay_ns
        self._waiting: list[tuple[int, int, Event]] = []
        self._count = 0

    def add(self, event: Event) -> None:
        """Add an event."""
        heapq.heappush(self._waiting, (event.stamp_ns, self._count, event))
        self._count += 1

    def ready(self, now_ns: int) -> Iterator[Event]:
        """The events that are due, removed."""
        while self._waiting and self._waiting[0][0] <= now_ns - self._delay_ns:
            yield heapq.heappop(self._waiting)[2]

    def rest(self) -> Iterator[Event]:
        """All remaining events, removed."""
        while self._waiting:
            yield heapq.heappop(self._waiting)[2]


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
    stop: Asked in every period whether to stop.
    max_duration_s: Longest time in the world, if it is below the world's own.

    Raises ConfigError if the method does not explore or lacks its drawing, or if the world has no lidar or odometry.
    """
    entry = _checked(config, world, inputs)
    with timing_compilation() as clock:
        started = clock.now()
        simulator = Simulator(world, world_path.parent)
        grid = true_map(simulator.scene, world.truth)
        method = method_builder("map", config)(
            config.method, config.seed, **{name: item.value for name, item in inputs.items()}
        )
        explorer: Explores = registry.load(entry.explorer)(
            method, config.method, drive_of(world), config.seed
        )
        limit_s, limit = min(
            (world.max_duration_s, "max_duration_s of the world"), (max_duration_s or np.inf, "--longest")
        )
        log_path = folder / LOG_NAME
        loop = _Loop(simulator, method, explorer, show=show, limit_s=limit_s, now=clock.now)
        with open_writer(log_path, force=False) as writer:
            loop.drive(writer.write, writer.write_truth, stop)
        before_result = clock.now()
        show(Progress(loop.events, loop.events, loop.scans, is_finishing=True))
        result = explorer.add_to(method.result())
        result = replace(result, measures=_with_ending(result.measures, loop))
        write_truth(folder / TRUTH_NAME, world, simulator.scene, loop.path, grid)
        finished = clock.now()
        hashes = {item.path.name: item.sha256 for item in inputs.values()}
        hashes |= {path.name: sha256_of(path) for path in (world_path, log_path)}
        run = Run(
            command="explore",
            config=config,
            log_path=Path(LOG_NAME),
            inputs=hashes,
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
        return Explored(
            run=run,
            ended=loop.ended,
            duration_s=simulator.time_s,
            travelled_m=simulator.robot.distance_m,
            clearance_m=loop.watch.clearance_m,
        )


class _Loop:
    """Runs the closed loop and stores the result in its attributes."""

    def __init__(
        self,
        simulator: Simulator,
        method: Method,
        explorer: Explores,
        show: Show,
        limit_s: float,
        now: Clock,
    ) -> None:
        self.simulator, self._method, self._explorer = simulator, method, explorer
        self._show, self._limit_s, self._now = show, limit_s, now
        self._order = InStampOrder(MAX_DELAY_NS)
        self.watch = ContactWatch(simulator)
        self.path: list[Odometry] = []
        self.counts: Counter[str] = Counter()
        self.ended: Ending = "interrupted"
        self.process_s = 0.0
        self.events = self.scans = 0

    def drive(
        self, write: Callable[[Event], None], write_truth: Callable[[Odometry], None], stop: Stop
    ) -> None:
        """Run until the explorer has finished, the time is over, the robot touches something, or `stop` returns True."""
        for extrinsics in self.simulator.extrinsics():
            self._add_event(extrinsics, write)
        self._record_truth(write_truth)
        while not self._is_over(stop):
            started = self._now()
            command = self._explorer.command()
            self.process_s += self._now() - started
            self._step(command, write)
            self._record_truth(write_truth)
        for event in self._order.rest():
            self._method.process(event)

    def _is_over(self, stop: Stop) -> bool:
        if self.watch.is_touching:
            self.ended = "contact"
        elif self._explorer.is_finished:
            self.ended = "finished"
        elif self.simulator.time_s >= self._limit_s:
            self.ended = "time"
        elif not stop():
            return False
        return True

    def _step(self, command: WheelCommand, write: Callable[[Event], None]) -> None:
        """DifferentialDrive for a tenth of a second, showing estimator and explorer what comes."""
        radius = self.simulator.world.robot.wheels.radius_m
        for _ in range(STEPS_PER_COMMAND):
            for event in self.simulator.step(command.left_mps / radius, command.right_mps / radius):
                self._add_event(event, write)
            if self.watch.is_touching:
                break
        started = self._now()
        now_ns = self.simulator.world.start_ns + round(self.simulator.time_s * 1e9)
        for event in self._order.ready(now_ns):
            self._method.process(event)
        self.process_s += self._now() - started
        self._show(Progress(self.events, max(self.events, 1), self.scans))

    def _add_event(self, event: Event, write: Callable[[Event], None]) -> None:
        write(event)
        self.events += 1
        if isinstance(event, LaserScan):
            self.scans += 1
            self.counts["read.scan"] += 1
        elif isinstance(event, Odometry):
            self.counts["read.odom"] += 1
        self._order.add(event)
        self._explorer.add(event)

    def _record_truth(self, write_truth: Callable[[Odometry], None]) -> None:
        pose = self.simulator.truth()
        write_truth(pose)
        self.path.append(pose)


def drive_of(world: WorldConfig) -> DifferentialDrive:
    """The drive of the world's robot."""
    wheels = world.robot.wheels
    return DifferentialDrive(
        radius_m=world.robot.radius_m,
        base_m=wheels.base_m,
        acceleration_mps2=wheels.acceleration_mps2,
        max_speed_mps=wheels.max_speed_mps,
        max_turn_radps=MAX_YAW_RATE_RADPS,
    )


def _checked(config: RunConfig[BaseModel], world: WorldConfig, inputs: Mapping[str, Input]) -> MethodEntry:
    name = config.method_name
    entry = registry.METHODS[name]
    if not entry.explorer:
        explorers = [n for n, e in registry.METHODS.items() if e.explorer]
        raise ConfigError(f"method.name: {name} cannot explore; methods that can: {', '.join(explorers)}")
    refuse_unknown_inputs(name, inputs)
    if world.sensors.lidar is None:
        raise ConfigError("sensors.lidar: this world's robot has no lidar; exploring needs one")
    if world.sensors.odometry is None or not world.sensors.odometry.publish_odometry:
        raise ConfigError("sensors.odometry: this world's robot publishes no odometry; exploring needs it")
    return entry


def _trajectory(path: list[Odometry]) -> Trajectory:
    stamps = np.array([pose.stamp_ns for pose in path], np.int64)
    return Trajectory(stamps, np.array([pose.pose for pose in path]).reshape(-1, 3))


def _with_ending(measures: Mapping[str, object], loop: _Loop) -> dict[str, object]:
    """The measures with the ending, duration, distance and clearance of the exploration."""
    exploration = measures.get("exploration")
    simulator = loop.simulator
    ending: dict[str, object] = {
        "ended": loop.ended,
        "duration_s": round(simulator.time_s, 2),
        "travelled_m": round(simulator.robot.distance_m, 2),
        "min_clearance_m": round(float(loop.watch.clearance_m), 3),
    }
    return {**measures, "exploration": {**ending, **(exploration if isinstance(exploration, dict) else {})}}


def _problems(loop: _Loop, limit: str) -> tuple[str, ...]:
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
