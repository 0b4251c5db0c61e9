from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from gridslam.maps.map_server import load_map
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.planning.options import PlanOptions
from gridslam.runs import warm_up as warm_up_module
from gridslam.runs.explore import explore
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run import run_map
from gridslam.runs.run_config import load_config
from gridslam.runs.warm_up import part_names, warm_up
from gridslam.simulation.world_config import load_world
from tests.conftest import REPOSITORY

HAND = REPOSITORY / "sample_logs" / "handmap-slam.truth"


def explore_for_two_seconds(folder: Path) -> None:
    world, path = load_world("hand-corridor-20", ("max_duration_s=2",), 0)
    inputs = read_inputs(
        {"drawing": REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png"}, "handmap-slam"
    )
    config = load_config("handmap-slam", ["method.start=[2.7, 3.2, 0]"])
    explore(config, world, path, inputs, folder, lambda progress: None, lambda: False)


def signatures() -> set[tuple[str, str]]:
    """(kernel, types of its arguments) of all machine code that this process has compiled or loaded."""
    return {
        (f"{name}.{function.py_func.__name__}", str(signature))
        for name, module in list(sys.modules.items())
        if name.startswith("gridslam.kernels")
        for function in vars(module).values()
        if isinstance(function, Dispatcher)
        for signature in function.signatures
    }


def test_after_a_warm_up_nothing_is_compiled(small_log: Path, tmp_path: Path) -> None:
    """Whatever the files of earlier processes hold: a warm-up uses all machine code that the built-in configs need."""
    done: list[str] = []
    warm_up(1, done.append)
    assert done == part_names()
    warm = signatures()
    samples = REPOSITORY / "sample_logs"
    logs = {"slam-sd": small_log} | {name: samples / f"{name}.mcap" for name in ("ir-scan", "stereo-bayes")}
    for method, log in logs.items():
        run_map(load_config(method), log, lambda progress: None, lambda: False)
    goal = np.array([15.0, 2.0, np.nan])
    plan_path(load_map(HAND / "map.yaml"), np.array([2.0, 2.0, 0.0]), goal, PlanOptions())
    explore_for_two_seconds(tmp_path)
    assert signatures() == warm


def test_parts_of_a_process_that_was_killed_are_compiled_in_this_one(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def distribute(parts: list[str], jobs: int, is_ready: Callable[[str], None]) -> None:
        is_ready(parts[0])
        raise BrokenProcessPool

    here: list[str] = []
    ready: list[str] = []
    monkeypatch.setattr(warm_up_module, "_distribute", distribute)
    monkeypatch.setattr(warm_up_module, "warm_up_part", here.append)
    warm_up(2, ready.append)
    assert ready == part_names() and here == ready[1:]
    assert "was killed" in caplog.text
