"""Lidars whose place on the robot is a joint that moves, that has noise, that is missing, or that is impossible."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.logs import LogConfig, open_log
from gridslam.logs.rotations import from_euler, yaw_of
from tests.logs.ros_samples import make, odometry, scan, tf, transform, write_mcap

S = 10**9
KINDS = ["scan", "odom"]


def turned(stamp_ns: int, parent: str, child: str, yaw: float, roll: float = 0.0, x: float = 0.0) -> object:
    w, qx, qy, qz = from_euler(roll, 0.0, yaw)
    found = transform(stamp_ns, parent, child, (x, 0.0, 0.0))
    found.transform.rotation = make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=w)
    return found


def drive(path: Path, *edges: object, static: tuple[object, ...] = ()) -> Path:
    messages = [("/tf_static", tf(*static))] if static else []
    messages += [("/tf", tf(edge)) for edge in edges]
    messages += [
        (topic, made(i * S)) for i in range(1, 5) for topic, made in (("/odom", odometry), ("/scan", scan))
    ]
    return write_mcap(path, messages)


def lidar_frame() -> str:
    return str(scan(0).header.frame_id)


def test_a_lidar_on_a_moving_joint_is_placed_at_the_stamp_of_each_scan(tmp_path: Path) -> None:
    joint = [turned(i * S // 2, "base_link", "pan", 0.1 * i) for i in range(12)]
    path = drive(tmp_path / "a.mcap", *joint, static=(turned(0, "pan", lidar_frame(), 0.05, x=0.2),))
    with open_log(path, kinds=KINDS) as log:
        events = list(log.events())
        assert any("sits on a joint that moves" in line for line in log.problems)
    placed = {e.child_frame_id: e for e in events if isinstance(e, Transform)}
    scans = [e for e in events if isinstance(e, LaserScan)]
    assert len(scans) == 4
    for found in scans:
        yaw = 0.2 * found.stamp_ns / S
        sensor_extrinsics = placed[found.frame_id]
        assert sensor_extrinsics.frame_id == "base_link"
        assert yaw_of(sensor_extrinsics.quat_wxyz) == pytest.approx(yaw + 0.05)
        assert sensor_extrinsics.translation_m == pytest.approx(
            (0.2 * math.cos(yaw), 0.2 * math.sin(yaw), 0.0)
        )


@pytest.mark.parametrize("is_on_joint", [False, True])
def test_a_lidar_tilted_by_tf_is_read_without_the_floor(tmp_path: Path, is_on_joint: bool) -> None:
    w, x, y, z = from_euler(0.0, 0.3, 0.0)
    laser = transform(0, "pan", lidar_frame(), (0.0, 0.0, 0.5), (w, x, y, z))
    pan = [turned(i * S // 2, "base_link", "pan", 0.1 * i * is_on_joint) for i in range(12)]
    path = drive(tmp_path / "a.mcap", *pan, static=(laser,))
    with open_log(path, kinds=KINDS) as log:
        scans = [e for e in log.events() if isinstance(e, LaserScan)]
        assert any("mounted with a tilt of 17.2 deg" in line for line in log.problems) != is_on_joint
    # Beams of 1, 2 and 3 m at -1, 0 and 1 rad (0.5 rad apart): they fall by 0.16, 0.59 and 0.48 m.
    assert [r == r for r in scans[0].ranges_m.tolist()] == [True, False, False]
    with open_log(path) as log:
        assert all(
            scan.ranges_m.tolist() == [1, 2, 3] for scan in log.events() if isinstance(scan, LaserScan)
        )


def test_noise_of_a_joint_is_no_motion(tmp_path: Path) -> None:
    joint = [turned(i * S, "base_link", lidar_frame(), 0.3 + 1e-9 * (i % 3)) for i in range(6)]
    with open_log(drive(tmp_path / "a.mcap", *joint), kinds=KINDS) as log:
        (sensor_extrinsics,) = log.sensor_extrinsics
        assert not log.problems
    assert yaw_of(sensor_extrinsics.quat_wxyz) == pytest.approx(0.3)


def test_a_gap_in_the_tree_of_frames_is_no_place_on_the_robot(tmp_path: Path) -> None:
    path = drive(tmp_path / "a.mcap", static=(turned(0, "plate", lidar_frame(), 0.0, x=0.4),))
    with open_log(path, kinds=KINDS) as log:
        (sensor_extrinsics,) = log.sensor_extrinsics
        assert any("its tree ends at plate" in line for line in log.problems)
    assert (sensor_extrinsics.frame_id, sensor_extrinsics.translation_m) == ("base_link", (0.0, 0.0, 0.0))


def test_a_lidar_in_an_optical_frame_is_refused_and_the_advice_works(tmp_path: Path) -> None:
    upright = turned(0, "base_link", lidar_frame(), -math.pi / 2, roll=-math.pi / 2)
    path = drive(tmp_path / "a.mcap", static=(upright,))
    with pytest.raises(ConfigError, match="upright plane"):
        open_log(path, kinds=KINDS)
    config = LogConfig.model_validate({"extrinsics": {lidar_frame(): {"x": 0.0, "y": 0.0, "yaw": 0.0}}})
    with open_log(path, config, KINDS) as log:
        assert len([e for e in log.events() if isinstance(e, LaserScan)]) == 4


@pytest.mark.parametrize("roll", [0.0, math.pi])
def test_a_level_lidar_is_taken_upside_down_too(tmp_path: Path, roll: float) -> None:
    path = drive(tmp_path / "a.mcap", static=(turned(0, "base_link", lidar_frame(), 0.2, roll=roll),))
    with open_log(path, kinds=KINDS) as log:
        assert not log.problems


def robots(path: Path, lidar: str) -> Path:
    found = scan(S)
    found.header.frame_id = lidar
    edges = [
        transform(i * S, f"robot{n}/odom", f"robot{n}/base_link", (n, i, 0)) for i in range(3) for n in (1, 2)
    ]
    return write_mcap(path, [*(("/tf", tf(edge)) for edge in edges), ("/scan", found)])


def test_of_two_robots_in_one_tf_that_with_the_lidar_is_used(tmp_path: Path) -> None:
    with open_log(robots(tmp_path / "a.mcap", "robot2/laser"), kinds=KINDS) as log:
        assert log.base_frame == "robot2/base_link"
        assert {e.x_m for e in log.events() if isinstance(e, Odometry)} == {2.0}


def test_of_two_robots_without_a_hint_the_advice_of_the_error_works(tmp_path: Path) -> None:
    path = robots(tmp_path / "a.mcap", "laser")
    with pytest.raises(ConfigError, match=r'odom: "robot1/odom->robot1/base_link"'):
        open_log(path, kinds=KINDS)
    config = LogConfig.model_validate({"topics": {"odom": "robot1/odom->robot1/base_link"}})
    with open_log(path, config, KINDS) as log:
        assert {e.x_m for e in log.events() if isinstance(e, Odometry)} == {1.0}


def test_odometry_whose_orientation_was_never_set_is_counted_as_unusable(tmp_path: Path) -> None:
    found = [odometry(i * S) for i in range(3)]
    found[1].pose.pose.orientation = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=0.0)
    path = write_mcap(tmp_path / "a.mcap", [("/odom", message) for message in found])
    with open_log(path, kinds=["odom"]) as log:
        assert len(list(log.events())) == 2
        assert log.counters["skipped.odom.not_finite"] == 1
