from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Transform
from gridslam.logs import rotations
from gridslam.logs.config import ExtrinsicsConfig, LogConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.open import open_log
from gridslam.logs.placement.extrinsics import refuse_several_places, sensor_transforms, usable
from tests.logs.ros_samples import odometry, scan, tf, transform, write_mcap
from tests.small_log import write_small_log

S = 10**9

angle = st.floats(-3.1, 3.1)
length = st.floats(-5.0, 5.0)
pose = st.tuples(st.tuples(length, length, length), st.tuples(angle, angle, angle))
Pose = tuple[tuple[float, float, float], tuple[float, float, float]]


def edge(
    parent: str, child: str, translation: tuple[float, float, float], euler: tuple[float, float, float]
) -> Transform:
    return Transform(0, parent, child, translation, rotations.from_euler(*euler), is_static=True)


def matrix(
    translation: tuple[float, float, float], quat_wxyz: tuple[float, float, float, float]
) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat(quat_wxyz, scalar_first=True).as_matrix()
    result[:3, 3] = translation
    return result


@given(pose, pose, pose)
def test_a_chain_is_composed_as_scipy_composes_it(first: Pose, second: Pose, third: Pose) -> None:
    edges = [edge("base", "a", *first), edge("a", "b", *second), edge("b", "laser", *third)]
    (placed_sensors,) = sensor_transforms(["laser"], edges, {}, "base", 5, MessageCounts())
    expected = np.eye(4)
    for link in edges:
        expected = expected @ matrix(link.translation_m, link.quat_wxyz)
    assert placed_sensors.frame_id == "base"
    assert placed_sensors.stamp_ns == 5
    np.testing.assert_allclose(
        matrix(placed_sensors.translation_m, placed_sensors.quat_wxyz), expected, atol=1e-12
    )


@given(pose, pose)
def test_a_base_below_the_root_is_gone_up_from(up: Pose, down: Pose) -> None:
    edges = [edge("footprint", "base", *up), edge("footprint", "laser", *down)]
    (placed_sensors,) = sensor_transforms(["laser"], edges, {}, "base", 0, MessageCounts())
    expected = np.linalg.inv(matrix(edges[0].translation_m, edges[0].quat_wxyz)) @ matrix(
        edges[1].translation_m, edges[1].quat_wxyz
    )
    np.testing.assert_allclose(
        matrix(placed_sensors.translation_m, placed_sensors.quat_wxyz), expected, atol=1e-12
    )


@given(angle, angle, angle)
def test_euler_angles_turn_about_fixed_axes(roll: float, pitch: float, yaw: float) -> None:
    ours = matrix((0, 0, 0), rotations.from_euler(roll, pitch, yaw))[:3, :3]
    np.testing.assert_allclose(ours, Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix(), atol=1e-12)


def test_config_wins_over_the_log() -> None:
    config = {"laser": ExtrinsicsConfig(x=0.3, yaw=math.pi / 2)}
    (placed_sensors,) = sensor_transforms(
        ["laser"], [edge("base", "laser", (1, 1, 1), (0, 0, 0))], config, "base", 0, MessageCounts()
    )
    assert placed_sensors.translation_m == (0.3, 0.0, 0.0)
    assert rotations.yaw_of(placed_sensors.quat_wxyz) == pytest.approx(math.pi / 2)


def test_unknown_extrinsics_are_the_identity_and_noted() -> None:
    message_counts = MessageCounts()
    (placed_sensors,) = sensor_transforms(["laser"], [], {}, "base", 0, message_counts)
    assert (placed_sensors.translation_m, placed_sensors.quat_wxyz) == rotations.IDENTITY
    assert "log.extrinsics.laser" in message_counts.problems[0]
    assert not message_counts.is_lossy


def test_a_camera_on_the_wall_hangs_on_its_own_root() -> None:
    edges = [edge("map", "bracket", (1, 2, 3), (0, 0, 0)), edge("bracket", "camera", (0, 0, 1), (0, 0, 0))]
    (placed_sensors,) = sensor_transforms(["camera"], edges, {}, "base", 0, MessageCounts())
    assert (placed_sensors.frame_id, placed_sensors.translation_m) == ("map", (1.0, 2.0, 4.0))


@pytest.mark.parametrize(
    ("translation", "quat_wxyz", "reason"),
    [
        ((math.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), "not_finite"),
        ((0.0, math.inf, 0.0), (1.0, 0.0, 0.0, 0.0), "not_finite"),
        ((0.0, 0.0, -1e308), (1.0, 0.0, 0.0, 0.0), "too_far"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "not_finite"),
        ((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0), "not_finite"),
    ],
)
def test_transforms_that_are_no_rigid_motion_are_left_out_and_counted(
    translation: tuple[float, float, float], quat_wxyz: tuple[float, float, float, float], reason: str
) -> None:
    good = edge("base", "laser", (1, 0, 0), (0, 0, 0))
    wrong = Transform(0, "base", "camera", translation, quat_wxyz, is_static=True)
    message_counts = MessageCounts()
    assert usable([wrong, good], message_counts) == [good]
    assert message_counts.counters == {f"skipped.tf.{reason}": 1}
    assert "base->camera" in message_counts.problems[0]


def test_a_cycle_of_frames_ends() -> None:
    edges = [edge("a", "b", (1, 0, 0), (0, 0, 0)), edge("b", "a", (1, 0, 0), (0, 0, 0))]
    (placed_sensors,) = sensor_transforms(["a"], edges, {}, "base", 0, MessageCounts())
    assert placed_sensors.child_frame_id == "a"


def test_a_chain_deeper_than_any_robot_is_not_followed_to_its_end() -> None:
    edges = [edge(f"f{i}", f"f{i + 1}", (0.1, 0.0, 0.0), (0.0, 0.0, 0.0)) for i in range(5000)]
    message_counts = MessageCounts()
    (placed,) = sensor_transforms(["f5000"], edges, {}, "f0", 0, message_counts, ["f5000"])
    assert placed.translation_m == (0.0, 0.0, 0.0)
    assert "no transform from f0 to f5000 (its tree ends at f4900)" in message_counts.problems[0]


def test_thousands_of_transforms_and_lidars_are_checked_in_seconds() -> None:
    frames = [f"f{i}" for i in range(20_000)]
    edges = [edge("base", frame, (float(k), 0.0, 0.0), (0.0, 0.0, 0.0)) for frame in frames for k in (0, 0)]
    started = time.process_time()
    refuse_several_places(edges, frames, "base", ())
    many_places = [edge("base", "laser", (float(k), 0.0, 0.0), (0.0, 0.0, 0.0)) for k in range(20_000)]
    with pytest.raises(ConfigError, match=r"contradict each other: on base x 0 .* x 3 "):
        refuse_several_places(many_places, ["laser"], "base", ())
    assert time.process_time() - started < 5.0


def test_extrinsics_of_a_frame_that_the_log_lacks_are_an_error(tmp_path: Path) -> None:
    folder = write_small_log(tmp_path / "log")
    with pytest.raises(ConfigError, match=r"log\.extrinsics\.lasr: the log has no such frame; .* laser"):
        open_log(folder, LogConfig(extrinsics={"lasr": ExtrinsicsConfig(x=1.0)}))


@pytest.mark.parametrize("other", [("base_link", (0.1, 0.0, 0.0)), ("camera", (0.0, 0.0, 0.0))])
def test_transforms_of_a_lidar_that_contradict_each_other_are_refused_and_the_advice_works(
    tmp_path: Path, other: tuple[str, tuple[float, float, float]]
) -> None:
    messages = [
        ("/tf_static", tf(transform(0, "base_link", "laser", (0.25, 0.0, 0.0)))),
        ("/tf_static", tf(transform(0, other[0], "laser", other[1]))),
        ("/odom", odometry(S)),
        ("/scan", scan(S)),
    ]
    path = write_mcap(tmp_path / "a.mcap", messages)
    with pytest.raises(ConfigError, match=r"contradict each other.*log: \{extrinsics: \{laser: \{x: 0.0"):
        open_log(path, kinds=["scan", "odom"])
    config = LogConfig.model_validate({"extrinsics": {"laser": {"x": 0.0, "y": 0.0, "yaw": 0.0}}})
    with open_log(path, config, ["scan", "odom"]) as log:
        assert log.sensor_extrinsics[0].translation_m == (0.0, 0.0, 0.0)


def test_a_transform_that_is_repeated_contradicts_nothing(tmp_path: Path) -> None:
    fixed = ("/tf_static", tf(transform(0, "base_link", "laser", (0.25, 0.0, 0.0))))
    path = write_mcap(tmp_path / "a.mcap", [fixed, fixed, ("/odom", odometry(S)), ("/scan", scan(S))])
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert not log.has_findings


def test_scans_in_a_frame_that_stands_still_are_refused(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", [("/odom", odometry(S)), ("/scan", scan(S, frame="odom"))])
    with pytest.raises(ConfigError, match="is in odom, which does not move with the robot"):
        open_log(path, kinds=["scan", "odom"])
    open_log(path).close()  # a conversion keeps what was recorded


def test_a_base_frame_that_the_log_lacks_is_an_error_for_a_method(tmp_path: Path) -> None:
    folder = write_small_log(tmp_path / "log")
    config = LogConfig(base_frame="base_footprnt")
    with pytest.raises(
        ConfigError, match=r"log\.base_frame: the log has no frame 'base_footprnt'; .* base_link"
    ):
        open_log(folder, config, ("scan", "odom"))
    open_log(folder, config).close()  # a conversion keeps what was recorded
    open_log(folder, LogConfig(base_frame="base_link"), ("scan", "odom")).close()


def test_odometry_and_scans_without_frames_are_not_taken_for_registered_ones(tmp_path: Path) -> None:
    nameless = odometry(S)
    nameless.header.frame_id = ""
    path = write_mcap(tmp_path / "a.mcap", [("/odom", nameless), ("/scan", scan(S, frame=""))])
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert {topic for topic, _ in log.events_by_topic()} >= {"/odom", "/scan"}
