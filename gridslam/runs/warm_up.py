"""Compiles all kernels by running every method and planner on a short scripted log, on several processes."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np

from gridslam.core.processes import shielded_from_terminal
from gridslam.kernels.grids.free_space import Profiles, testimony_of_shifts
from gridslam.kernels.machine_code_cache import MachineCodeCache
from gridslam.lidar_slam.map_consistency.observations import SECTORS, TOLERANCES
from gridslam.maps.drawings.drawing import RESOLUTION_M as DRAWING_CELL_M
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import Method, RunResult
from gridslam.methods.registry import BUILT_IN
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.planning.dwa import DifferentialDrive
from gridslam.planning.options import PlanOptions
from gridslam.runs.run_config import load_config
from gridslam.simulation.driving.scripted import Noise, scripted_drawing, scripted_log
from gridslam.simulation.world_config import WorldConfig

_logger = logging.getLogger("gridslam")
DRIVE = DifferentialDrive(
    radius_m=0.25, base_m=0.4, acceleration_mps2=0.8, max_speed_mps=1.5, max_yaw_rate_radps=10.0
)
COMMAND_EVERY = 50  # events
STUTTER = Noise(frozen=range(100, 112))  # tracking is lost and recovers
HALL_CORNER_M = (-1.0, -1.0)  # the drawing of the hall has a margin
PLAN_START, PLAN_GOAL = np.array([2.0, 1.5, 0.0]), np.array([12.0, 7.5, np.nan])
ROOM = {
    "walls": [{"rectangle": [-4, -3, 4, 3]}],
    "robot": {"start": [-1, 0, 0], "route": [[0, 0]]},
    "sensors": {"lidar": {"rate_hz": 10, "beams": 61, "field_of_view_deg": 180, "range_max_m": 10}},
}


def warm_up(jobs: int = 1, report: Callable[[str], None] = lambda part: None) -> None:
    """Run each mapper, localizer and explorer with its built-in config, and plan paths, so that their machine code is cached.

    Kernels that only other settings use are compiled at their first use. The parts are shared among `jobs` processes;
    `report` is called with the name of each that is done.
    """
    waiting = part_names()

    def is_ready(part: str) -> None:
        waiting.remove(part)
        report(part)

    if jobs > 1:
        try:
            _distribute(list(waiting), jobs, is_ready)
        except BrokenProcessPool:
            _logger.warning(
                "a process that compiled was killed (memory may be short); the rest is compiled in one"
            )
    for part in list(waiting):
        warm_up_part(part)
        is_ready(part)


def _distribute(parts: list[str], jobs: int, is_ready: Callable[[str], None]) -> None:
    """Warm up parts in several processes. Raises BrokenProcessPool: one of them was killed."""
    complaints: set[str] = set()
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_be_quiet) as processes:
        try:
            with shielded_from_terminal():
                running = {processes.submit(_warm_up_part, part): part for part in parts}
            for done in as_completed(running):
                complaints.update(done.result())
                is_ready(running[done])
        except BaseException:
            processes.shutdown(wait=False, cancel_futures=True)
            for process in active_children():
                process.terminate()
            raise
    for complaint in sorted(complaints)[:1]:
        _logger.warning("%s", complaint)


def _be_quiet() -> None:
    """Silence the log of a process that warms up: its lines are not about any data of the user."""
    _logger.addHandler(logging.NullHandler())


def _warm_up_part(part: str) -> list[str]:
    """Warm up one part; returns the reason why its machine code could not be kept, if any."""
    warm_up_part(part)
    return [MachineCodeCache.complaint] if MachineCodeCache.complaint else []


def part_names() -> list[str]:
    """Names of the parts that are warmed up one by one; those that take longest come first."""
    names = [f"{name} map" for name, entry in BUILT_IN.items() if entry.mapper]
    names += [f"{name} explore" for name, entry in BUILT_IN.items() if entry.explorer]
    names += [f"{name} localize" for name, entry in BUILT_IN.items() if entry.localizer]
    return [
        *names[:1],
        "plan",
        *names[1:],
        "contradictions",
        *(["simulate"] if find_spec("shapely") else []),  # of the extra `sim`
    ]


def warm_up_part(part: str) -> None:
    """Run the part of that name."""
    if part == "plan":
        _plan()
    elif part == "simulate":
        _simulate()
    elif part == "contradictions":
        _contradictions()
    else:
        method, command = part.split()
        if command == "map":
            _result(_mapper(method))
        elif command == "explore":
            _explore(method)
        else:
            _result(registry.load(BUILT_IN[method].localizer)(load_config(method).method, 0, _hall()))


def _hall() -> OccupancyGrid:
    """The map of the scripted log."""
    drawing = scripted_drawing()
    return OccupancyGrid(
        (drawing.levels == 0).astype(np.float32), GridGeometry(DRAWING_CELL_M, HALL_CORNER_M)
    )


def _plan() -> None:
    """Plan a path in the hall, forwards only and with reversing."""
    for reverse in (False, True):
        plan_path(_hall(), PLAN_START, PLAN_GOAL, PlanOptions(reverse=reverse))


def _mapper(name: str) -> Method:
    """The mapper of a method with its built-in config, as a user runs it."""
    entry = BUILT_IN[name]
    method: Method = registry.load(entry.mapper)(
        load_config(name).method,
        0,
        **{kind.name: registry.load(kind.example)() for kind in entry.inputs if kind.is_needed},
    )
    return method


def _explore(name: str) -> None:
    """Query the explorer for commands along the scripted drive."""
    method = _mapper(name)
    explorer = registry.load(BUILT_IN[name].explorer)(method, load_config(name).method, DRIVE, 0)
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


def _contradictions() -> None:
    """Compare a scan with a displaced point, as in maps that contradict themselves; the map of the scripted log does not."""
    nothing = np.zeros((1, SECTORS), np.float32)
    testimony_of_shifts(
        np.zeros((1, 2)),
        np.zeros((1, 2)),
        poses=np.zeros((1, 3)),
        viewpoints=np.zeros((1, 2)),
        profiles=Profiles(nothing, nothing),
        limits=TOLERANCES,
    )


def _result(method: Method) -> RunResult:
    """The result of two laps, so that loops are closed."""
    for event, _ in scripted_log(laps=2, noise=STUTTER):
        method.process(event)
    return method.result()
