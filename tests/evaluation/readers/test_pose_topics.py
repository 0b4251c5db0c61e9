"""Poses of a bag: any pose-like topic, and pairs of tf frames along the tree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError, InputError
from gridslam.core.messages import AbsolutePose, Odometry, Transform, readonly
from gridslam.core.poses import quaternion_of_yaw
from gridslam.evaluation.inputs import Truth
from gridslam.evaluation.readers.from_files import load_result
from gridslam.evaluation.readers.pose_topics import read_topic
from gridslam.logs.mcap.writer import McapWriter
from gridslam.logs.ros.encode import encode

STAMPS = (1_700_000_000_000_000_000 + np.arange(30) * 50_000_000).tolist()
BASE = np.column_stack([0.1 * np.arange(30), 0.02 * np.arange(30), 0.01 * np.arange(30)])
AHEAD = np.array([1.0, 0.0, 0.0])
T_MAP_ODOM = np.array([1.0, -2.0, 0.4])
T_WORLD_MAP = np.array([5.0, 0.0, 0.0])


def transform(stamp: int, parent: str, child: str, pose: np.ndarray, is_static: bool = False) -> Transform:
    w, x, y, z = quaternion_of_yaw(float(pose[2])).tolist()
    return Transform(stamp, parent, child, (float(pose[0]), float(pose[1]), 0.0), (w, x, y, z), is_static)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    path = tmp_path / "bag.mcap"
    with McapWriter(path) as writer:
        for message in encode(transform(STAMPS[0], "world", "map", T_WORLD_MAP, is_static=True)):
            writer.append(message)
        for k, (stamp, pose) in enumerate(zip(STAMPS, BASE, strict=True)):
            events = [
                (Odometry(stamp, "odom", *pose.tolist(), 0.0, 0.0, "base_link"), "/odom"),
                (
                    AbsolutePose(
                        stamp, "map", readonly(pose + AHEAD, np.float64), readonly(np.eye(3), np.float64)
                    ),
                    "/amcl_pose",
                ),
                (transform(stamp, "odom", "base_link", pose), None),
            ]
            if k % 5 == 0 or k == len(STAMPS) - 1:
                events.append((transform(stamp, "map", "odom", T_MAP_ODOM), None))
            for event, topic in events:
                for message in encode(event, topic) if topic else encode(event):
                    writer.append(message)
    return path


def test_odometry_and_poses_with_covariance_are_read(bag: Path) -> None:
    odometry, amcl = read_topic(bag, "/odom"), read_topic(bag, "/amcl_pose")
    assert odometry.stamps_ns.tolist() == amcl.stamps_ns.tolist() == STAMPS
    assert odometry.trajectory.poses == pytest.approx(BASE)
    assert amcl.trajectory.poses == pytest.approx(BASE + AHEAD)


@pytest.mark.parametrize(
    ("pair", "expected"),
    [
        ("odom->base_link", BASE),
        ("map->base_link", se2.compose(T_MAP_ODOM, BASE)),
        ("world -> base_link", se2.compose(T_WORLD_MAP, se2.compose(T_MAP_ODOM, BASE))),
    ],
)
def test_a_pair_of_frames_is_composed_along_the_tree(bag: Path, pair: str, expected: np.ndarray) -> None:
    found = read_topic(bag, pair)
    assert found.stamps_ns.tolist() == STAMPS
    assert found.trajectory.poses == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("topic", "says"),
    [
        ("/pose", r"--truth-topic: .*bag.mcap: the log has no poses on '/pose'; it has .*/amcl_pose"),
        ("map->laser", r"no such chain of frames; it has map->odom, odom->base_link"),
        ("base_link->map", "no such chain of frames"),
        ("world->map", "do not move"),
    ],
)
def test_a_topic_that_is_not_there_is_an_error_with_those_that_are(bag: Path, topic: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        read_topic(bag, topic)


def test_a_trajectory_file_has_no_topics_and_a_log_needs_one(bag: Path, tmp_path: Path) -> None:
    trajectory = tmp_path / "poses.tum"
    trajectory.write_text("1 0 0 0 0 0 0 1\n")
    with pytest.raises(
        ConfigError, match=r"--truth-topic /odom: .* is a trajectory file, which has no topics"
    ):
        read_topic(trajectory, "/odom")
    with pytest.raises(InputError, match="a log; name the topic of its poses with --topic"):
        load_result(bag, Truth())
