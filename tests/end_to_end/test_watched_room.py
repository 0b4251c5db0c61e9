"""A room that looks the same from both ends: only its camera shows where the robot is, from MCAP as from a CSV folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.runs.run import Run, run_localize
from gridslam.runs.run_config import load_config
from gridslam.simulation.record import record_world, truth_folder
from tests.simulation.places import room

pytest.importorskip("embreex", reason="cameras need the extra sim")

CAMERA: dict[str, Any] = {
    "name": "eye", "kind": "rgbd", "rate_hz": 2.0, "width_px": 112, "height_px": 84, "focal_px": 75.0, "depth_max_m": 10,
    "extrinsics": {"x": 0.1, "y": 2.5, "z": 2.5, "pitch_deg": 28}, "latency_s": 0.03, "jitter_s": 0.005,
}  # fmt: skip


@pytest.fixture(scope="module")
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The robot drives about for a quarter of a minute, and somebody walks along the other side."""
    world = room(
        people=[{"path": [[6.5, 3.6], [2.5, 3.9]], "speed_mps": 0.7, "colour": [150, 60, 60]}],
        robot={"start": [2.5, 1.5, 0], "route": [[5.5, 1.5], [5.0, 3.0], [2.2, 2.0]], "wait_at_start_s": 3.0},
        sensors={"lidar": {"rate_hz": 5, "beams": 90}, "odometry": {}},
        fixed_cameras=[CAMERA],
    )
    path = tmp_path_factory.mktemp("watched") / request.param
    record_world(world, Path(), path)
    return path


def located(log: Path, seed: int, *settings: str) -> Run:
    config = load_config("ispace-mcl", list(settings), seed)
    return run_localize(config, log, truth_folder(log) / "map.yaml", lambda progress: None, lambda: False)


def last_error(run: Run) -> float:
    assert run.truth is not None
    return float(np.hypot(*(run.result.trajectory.poses[-1, :2] - run.truth.poses[-1, :2])))


@pytest.mark.parametrize(("log", "seed"), [("log.mcap", 0), ("folder", 1)], indirect=["log"])
def test_the_camera_distinguishes_the_two_ends_of_the_room(log: Path, seed: int) -> None:
    run = located(log, seed)
    assert last_error(run) < 0.2
    counters = run.result.counters
    assert counters["used.image"] == counters["used.depth"] > 15
    assert counters["skipped.image.warm_up"] == 5
    assert run.result.pictures["cameras"].rgb.shape[2] == 3
    assert run.result.measures["cameras"]["eye_optical"]["coverage_m2"] > 10.0  # type: ignore[index]
    assert sum(run.counts.skipped_by_reason.values()) >= 5


@pytest.mark.parametrize("log", ["log.mcap"], indirect=True)
def test_a_start_pose_at_the_wrong_end_fits_every_scan_and_only_the_camera_puts_it_right(log: Path) -> None:
    mirrored = "method.start=[5.5, 3.5, 3.14]"
    assert last_error(located(log, 0, mirrored, "method.cameras.enabled=false")) > 1.5
    assert last_error(located(log, 0, mirrored)) < 0.2
