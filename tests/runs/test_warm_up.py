from __future__ import annotations

from pathlib import Path

import numpy as np

from gridslam.kernels.compiling import announcing_compilation
from gridslam.maps.map_server import load_map
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.planning.options import PlanOptions
from gridslam.runs.explore import explore
from gridslam.runs.inputs import read_inputs
from gridslam.runs.run import run_map
from gridslam.runs.run_config import load_run_config
from gridslam.runs.warm_up import part_names, warm_up
from gridslam.simulation.world_config import load_world
from tests.conftest import REPOSITORY

HAND = REPOSITORY / "sample_logs" / "handmap-slam.truth"


def explore_for_two_seconds(folder: Path) -> None:
    world, path = load_world("hand-corridor-20", ("max_duration_s=2",), 0)
    inputs = read_inputs(
        {"drawing": REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png"}, "handmap-slam"
    )
    config = load_run_config("handmap-slam", ["method.start=[2.7, 3.2, 0]"])
    explore(config, world, path, inputs, folder, lambda progress: None, lambda: False)


def test_after_a_warm_up_nothing_is_compiled(small_log: Path, tmp_path: Path) -> None:
    done: list[str] = []
    warm_up(2, done.append)
    assert sorted(done) == sorted(part_names())
    reported: list[str] = []
    with announcing_compilation(lambda: reported.append("compiling")):
        run_map(load_run_config("slam-sd"), small_log, lambda progress: None, lambda: False)
        infrared = REPOSITORY / "sample_logs" / "ir-scan.mcap"
        run_map(load_run_config("ir-scan"), infrared, lambda progress: None, lambda: False)
        stereo = REPOSITORY / "sample_logs" / "stereo-bayes.mcap"
        run_map(load_run_config("stereo-bayes"), stereo, lambda progress: None, lambda: False)
        plan_path(
            load_map(HAND / "map.yaml"),
            np.array([2.0, 2.0, 0.0]),
            np.array([15.0, 2.0, np.nan]),
            PlanOptions(),
        )
        explore_for_two_seconds(tmp_path)
    assert reported == []
