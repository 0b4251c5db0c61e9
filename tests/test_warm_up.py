from __future__ import annotations

from pathlib import Path

from gridslam.kernels.compiling import telling_of_compilation
from gridslam.run import run_map
from gridslam.run_config import load_run_config
from gridslam.warm_up import warm_up
from tests.conftest import REPOSITORY


def test_after_a_warm_up_a_run_compiles_nothing(small_log: Path) -> None:
    warm_up()
    told: list[str] = []
    with telling_of_compilation(lambda: told.append("compiling")):
        run_map(load_run_config("slam-sd"), small_log, lambda progress: None, lambda: False)
        infrared = REPOSITORY / "sample_logs" / "ir-scan.mcap"
        run_map(load_run_config("ir-scan"), infrared, lambda progress: None, lambda: False)
        stereo = REPOSITORY / "sample_logs" / "stereo-bayes.mcap"
        run_map(load_run_config("stereo-bayes"), stereo, lambda progress: None, lambda: False)
    assert told == []
