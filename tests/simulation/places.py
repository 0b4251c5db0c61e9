"""Small worlds that tests are made in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gridslam.core.messages import Event
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import WorldConfig, validate_world

EXACT_LIDAR = {
    "noise_m": 0, "noise_per_m": 0, "tail_fraction": 0, "dropout": 0, "grazing_dropout": 0,
    "outliers": 0, "mixing_probability": 0, "resolution_m": 0, "sweep_s": 0, "range_min_m": 0.01,
}  # fmt: skip


def room(**changes: Any) -> WorldConfig:
    """A room of 8 x 5 m with a robot that stands in it for ever, unless `changes` say otherwise."""
    document: dict[str, Any] = {
        "walls": [{"rectangle": [0, 0, 8, 5]}],
        "robot": {"start": [3, 2, 0], "wait_at_start_s": 1e6},
        "sensors": {},
        **changes,
    }
    return validate_world(document, "test world")


def recorded(world: WorldConfig, steps: int, command: tuple[float, float] = (0.0, 0.0)) -> list[Event]:
    """The messages of the sensors in `steps` steps with constant wheel speeds."""
    simulator = Simulator(world, Path())
    return [event for _ in range(steps) for event in simulator.step(*command)]


def driven(world: WorldConfig) -> tuple[Simulator, list[Event]]:
    """The whole route: the simulator afterwards, and all events but the truth."""
    simulator = Simulator(world, Path())
    return simulator, [event for event, is_truth in drive_route(simulator) if not is_truth]
