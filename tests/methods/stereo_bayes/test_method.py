"""stereo-bayes on its sample log, with and without odometry, and on bad input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.errors import MethodError
from gridslam.core.messages import AbsolutePose, CameraInfo, Disparity, Odometry, StereoPair, Transform
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.method import StereoBayes, StereoBayesPose
from tests.conftest import REPOSITORY, Program

SAMPLE = REPOSITORY / "sample_logs" / "stereo-bayes.mcap"
TRUTH = SAMPLE.with_suffix(".truth")
QUAT = (0.5, -0.5, 0.5, -0.5)


def evaluated(program: Program, run: Path) -> dict[str, dict[str, object]]:
    done = program("evaluate", run, "--truth", TRUTH, "--json")
    assert done.returncode == 0, done.stderr
    found: dict[str, dict[str, object]] = json.loads(done.stdout)
    return found


def test_the_sample_log_becomes_a_map_of_the_room(program: Program, tmp_path: Path) -> None:
    done = program("map", SAMPLE, "-c", "stereo-bayes", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    found = evaluated(program, tmp_path / "run")
    assert found["ape"]["trans"]["rmse"] < 0.05  # type: ignore[index]
    assert found["map"]["accuracy"]["mean"] < 0.08  # type: ignore[index]
    assert (tmp_path / "run" / "obstacles.csv").read_text().count("\n") > 2


def test_localize_is_the_pose_filter_alone_and_needs_no_map(program: Program, tmp_path: Path) -> None:
    done = program("localize", SAMPLE, "-c", "stereo-bayes", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert evaluated(program, tmp_path / "run")["ape"]["trans"]["rmse"] < 0.05  # type: ignore[index]
    assert not (tmp_path / "run" / "map.pgm").exists()


def test_other_methods_still_ask_for_a_map(program: Program, tmp_path: Path) -> None:
    done = program("localize", SAMPLE, "-c", "ispace-mcl", "-o", tmp_path / "run")
    assert done.returncode == 2
    assert "--map" in done.stderr


def disparity(stamp_ns: int, pixels: np.ndarray, focal_px: float = 100.0) -> Disparity:
    return Disparity(stamp_ns, "optical", pixels.astype(np.float32), focal_px, 0.1, "head")


def placed_sensors() -> Transform:
    return Transform(0, "base_link", "optical", (0.0, 0.0, 0.5), QUAT, is_static=True)


def mapper(**settings: object) -> StereoBayes:
    return StereoBayes(StereoBayesConfig.model_validate({"max_range_m": 3.0, **settings}), 0)


def test_disparities_of_the_log_are_mapped() -> None:
    method = mapper()
    method.process(placed_sensors())
    for k in range(30):
        method.process(Odometry(k * 10**8, "odom", 0.0, 0.0, 0.0))
        method.process(disparity(k * 10**8, np.full((40, 80), 5.0)))
    result = method.result()
    assert result.counters["used.disparity"] == 30
    assert result.occupancy is not None
    assert np.nanmax(result.occupancy.probability) > 0.9


@pytest.mark.parametrize("value", [np.nan, np.inf, -3.0, 0.0, 1e9])
def test_invalid_disparities_give_no_map(value: float) -> None:
    method = mapper()
    method.process(placed_sensors())
    for k in range(30):
        method.process(Odometry(k * 10**8, "odom", 0.0, 0.0, 0.0))
        method.process(disparity(k * 10**8, np.full((40, 80), value)))
    result = method.result()
    assert result.occupancy is None or not result.occupancy.probability.size
    assert result.counters["rays.unknown"] > 0


def test_a_log_without_a_usable_image_is_an_error_that_says_what_it_needs() -> None:
    still, blind = mapper(), mapper()
    for k in range(5):
        still.process(disparity(k * 10**9, np.full((40, 80), 5.0)))
        blind.process(Odometry(k * 10**9, "odom", 0.0, 0.0, 0.0))
        blind.process(disparity(k * 10**9, np.full((40, 80), 5.0), focal_px=0.0))
    with pytest.raises(MethodError, match=r"5 x no motion.*need odometry"):
        still.result()
    with pytest.raises(MethodError, match=r"5 x no calibration.*focal length and baseline"):
        blind.result()


def test_pairs_without_calibration_or_too_small_are_not_used() -> None:
    method = mapper()
    small = np.zeros((3, 40), np.uint8)
    info = CameraInfo(0, "optical", 40, 3, np.eye(3), np.eye(3, 4), np.zeros(5))
    right = CameraInfo(
        0, "optical", 40, 3, np.eye(3), np.array([[1.0, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0]]), np.zeros(5)
    )
    method.process(Odometry(0, "odom", 0.0, 0.0, 0.0))
    method.process(AbsolutePose(0, "map", np.zeros(3), 0.01 * np.eye(3)))
    method.process(StereoPair(0, "optical", small, small))
    for calibration in (info, right):
        method.process(calibration)
    method.process(Odometry(10**9, "odom", 0.0, 0.0, 0.0))
    method.process(StereoPair(10**9, "optical", small, small))
    with pytest.raises(MethodError, match=r"1 x no calibration, 1 x size.*camera_info of both cameras"):
        method.result()


def test_no_events_give_an_empty_result() -> None:
    assert len(mapper().result().trajectory) == 0
    assert len(StereoBayesPose(StereoBayesConfig(), 0).result().trajectory) == 0


@pytest.mark.real_data
def test_visual_odometry_follows_a_street(data_dir: Path, program: Program, tmp_path: Path) -> None:
    from tests.benchmarks.kitti import STREET, true_path, write_street

    log = write_street(data_dir, tmp_path / "street")
    overrides = [part for setting in STREET for part in ("--set", setting)]
    done = program("map", log, "-c", "stereo-bayes", *overrides, "--end", "2.5", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    found = np.loadtxt(tmp_path / "run" / "trajectory.tum")[:, 1:3]
    truth = true_path(data_dir).poses[: len(found), :2]
    length = np.hypot(*np.diff(truth, axis=0).T).sum()
    assert length > 15.0
    assert np.hypot(*(found[-1] - truth[-1])) < 0.02 * length
