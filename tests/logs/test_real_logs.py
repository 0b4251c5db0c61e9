from __future__ import annotations

import bz2
import math
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import AbsolutePose, LaserScan, Odometry, Transform
from gridslam.logs import LogConfig, open_log
from gridslam.logs.convert import convert_log
from tests.logs.mutations import fingerprint

pytestmark = pytest.mark.real_data


@pytest.mark.parametrize(
    ("name", "scans", "beams", "first_ns", "last_ns", "range_max"),
    [
        ("aces", 7374, 180, 70_289_900_000, 1_435_809_999_000, 50.0),
        ("mit-csail", 1988, 361, 1_134_864_629_895_182_000, 1_134_865_053_892_206_000, np.float32(81.91)),
    ],
)
def test_the_carmen_logs_are_read_completely(
    data_dir: Path, name: str, scans: int, beams: int, first_ns: int, last_ns: int, range_max: float
) -> None:
    with open_log(data_dir / "lidar" / f"{name}.clf.bz2", kinds=["scan", "odom"]) as log:
        found = [e for e in log.events() if isinstance(e, LaserScan)]
        assert len(found) == log.counters["read.scan"] == log.counters["read.odom"] == scans
        assert not log.is_lossy, log.problems
        assert not log.problems
    assert {len(s.ranges_m) for s in found} == {beams}
    assert (found[0].stamp_ns, found[-1].stamp_ns) == (first_ns, last_ns)
    assert {s.range_max_m for s in found} == {range_max}


def test_wean_hall_is_read_completely(data_dir: Path) -> None:
    for name, odometry, scans in (("robotdata1", 2218, 713), ("robotdata2", 5377, 2251)):
        with open_log(data_dir / "wean_hall" / f"{name}.log.gz", kinds=["scan", "odom"]) as log:
            events = list(log.events())
            assert not log.problems
            assert [m.translation_m for m in log.sensor_extrinsics] == [(0.25, 0.0, 0.0)]
        found = [e for e in events if isinstance(e, LaserScan)]
        assert sum(isinstance(e, Odometry) for e in events) == odometry
        assert len(found) == scans
        assert {len(s.ranges_m) for s in found} == {180}


@pytest.mark.parametrize("name", ["ros2", "ros2/macfirst_floor_take_2_0.db3"])
def test_the_turtlebot_bag_is_read_completely(data_dir: Path, name: str) -> None:
    with open_log(data_dir / name, kinds=["scan", "odom"]) as log:
        extrinsics, *events = log.events()
        assert not log.problems
    scans = [e for e in events if isinstance(e, LaserScan)]
    assert len(scans) == 357
    assert {len(s.ranges_m) for s in scans} == {720}
    assert sum(isinstance(e, Odometry) for e in events) == 920
    assert isinstance(extrinsics, Transform)
    assert extrinsics.child_frame_id == "rplidar_link"
    w, _, _, z = extrinsics.quat_wxyz
    assert 2 * math.atan2(z, w) == pytest.approx(math.pi / 2)
    stamps = [e.stamp_ns for e in events]
    assert stamps == sorted(stamps)


def test_the_nav2_log_is_read_completely(data_dir: Path) -> None:
    config = LogConfig(truth="/amcl_pose")
    with open_log(data_dir / "ros2" / "nav2_turtlebot.mcap", config, ["odom"]) as log:
        assert sum(isinstance(e, Odometry) for e in log.events()) == 2639
        truth = log.truth()
        assert not log.problems
    assert truth is not None
    assert len(truth) == 135
    with open_log(data_dir / "ros2" / "nav2_turtlebot.mcap") as log:
        assert sum(isinstance(e, AbsolutePose) for e in log.events()) == 135
        assert {i.detail: i.count for i in log.streams if i.kind == "tf"} == {
            "base_link->left_wheel": 1862,
            "base_link->right_wheel": 1862,
            "map->odom": 921,
            "odom->base_link": 2639,
        }


@pytest.fixture(scope="module")
def aces_prefix(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("aces") / "prefix.clf"
    with bz2.open(data_dir / "lidar" / "aces.clf.bz2") as stream:
        path.write_bytes(b"".join(line for _, line in zip(range(1500), stream, strict=False)))
    return path


@pytest.mark.parametrize("name", ["aces.mcap", "aces"])
def test_a_converted_log_gives_the_same_events_to_the_last_bit(
    aces_prefix: Path, tmp_path: Path, name: str
) -> None:
    with open_log(aces_prefix) as log:
        convert_log(log, tmp_path / name)
    with (
        open_log(aces_prefix, kinds=["scan", "odom"]) as log,
        open_log(tmp_path / name, kinds=["scan", "odom"]) as again,
    ):
        original, converted = list(log.events()), list(again.events())
        assert len(original) > 1400
        assert list(map(fingerprint, converted)) == list(map(fingerprint, original))
        assert not again.problems


def test_the_other_real_logs_convert_to_the_same_events(data_dir: Path, tmp_path: Path) -> None:
    for number, name in enumerate(("ros2", "ros2/nav2_turtlebot.mcap", "wean_hall/robotdata1.log.gz")):
        with open_log(data_dir / name) as log:
            original = list(map(fingerprint, log.events()))
        for suffix in (".mcap", ""):
            with open_log(data_dir / name) as log:
                convert_log(log, tmp_path / f"log{number}{suffix}")
            with open_log(tmp_path / f"log{number}{suffix}") as again:
                assert list(map(fingerprint, again.events())) == original, (name, suffix)
