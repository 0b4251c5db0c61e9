"""Compiles all kernels by running every method and planner on a short scripted log."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.methods.registry import BUILT_IN, MethodEntry
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.planning.dwa import DifferentialDrive
from gridslam.planning.options import PlanOptions
from gridslam.simulation.scripted import scripted_log
from gridslam.simulation.world_config import WorldConfig

DRIVE = DifferentialDrive(
    radius_m=0.25, base_m=0.4, acceleration_mps2=0.8, max_speed_mps=1.5, max_turn_radps=10.0
)
COMMAND_EVERY = 50  # events
ROOM = {
    "walls": [{"rectangle": [-4, -3, 4, 3]}],
    "robot": {"start": [-1, 0, 0], "route": [[0, 0]]},
    "sensors": {"lidar": {"rate_hz": 10, "beams": 61, "field_of_view_deg": 180, "range_max_m": 10}},
}


def warm_up() -> None:
    """Run each mapper, localizer and explorer with default settings, and plan a path, so that numba caches their kernels.

    Kernels that only other settings use are compiled at their first use.
    """
    made: RunResult | None = None
    for entry in BUILT_IN.values():
        if entry.mapper:
            result = _result(_mapper(entry))
            made = made or result
        if entry.explorer:
            _explore(entry)
    assert made is not None and made.occupancy is not None
    for entry in BUILT_IN.values():
        if entry.localizer:
            _result(registry.load(entry.localizer)(registry.load(entry.config)(), 0, made.occupancy))
    poses = made.trajectory.poses
    for reverse in (False, True):
        plan_path(made.occupancy, poses[0], poses[len(poses) // 4], PlanOptions(reverse=reverse))
    if find_spec("shapely"):  # installed with the extra `sim`
        _simulate()


def _mapper(entry: MethodEntry) -> Method:
    method: Method = registry.load(entry.mapper)(
        registry.load(entry.config)(),
        0,
        **{kind.name: registry.load(kind.example)() for kind in entry.inputs if kind.is_needed},
    )
    return method


def _explore(entry: MethodEntry) -> None:
    """Query the explorer for commands along the scripted drive."""
    method = _mapper(entry)
    explorer = registry.load(entry.explorer)(method, registry.load(entry.config)(), DRIVE, 0)
    for number, (event, _) in enumerate(scripted_log(laps=1)):
        method.process(event)
        explorer.add(event)
        if number % COMMAND_EVERY == COMMAND_EVERY - 1 and not explorer.is_finished:
            explorer.command()


def _simulate() -> None:
    """Run the simulator for a second."""
    from gridslam.simulation.simulator import Simulator

    simulator = Simulator(WorldConfig.model_validate(ROOM), Path())
    for _ in range(100):
        simulator.step(1.0, 1.0)


def _result(method: Method) -> RunResult:
    """The result of two laps, so that loops are closed."""
    for event, _ in scripted_log(laps=2):
        method.process(event)
    return method.result()
