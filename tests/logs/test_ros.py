from __future__ import annotations

import base64
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from PIL import Image as Pillow

from gridslam.core.errors import ConfigError, LogError
from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Event,
    Image,
    LaserScan,
    Odometry,
    Range,
    Transform,
    WheelTicks,
)
from gridslam.logs import LogConfig, open_log, require_streams
from gridslam.logs.convert import convert_log
from gridslam.logs.ros.container import Schema
from gridslam.logs.ros.types import is_standard
from tests.conftest import Program
from tests.logs.mutations import fingerprint
from tests.logs.ros_samples import HUMBLE, header, make, odometry, scan, tf, transform, write_json, write_mcap

S = 10**9


def events(path: Path, config: LogConfig | None = None, kinds: tuple[str, ...] | None = None) -> list[Event]:
    with open_log(path, config, kinds) as log:
        return [e for e in log.events() if not (isinstance(e, Transform) and e.is_static)]


def moving(*messages: Any) -> list[tuple[str, Any]]:
    topics = {"LaserScan": "/scan", "Odometry": "/odom"}
    return [(topics[m.__msgtype__.rsplit("/", 1)[1]], m) for m in messages]


def test_the_fast_and_the_general_decoder_give_the_same_events(tmp_path: Path) -> None:
    ranges = np.random.default_rng(1).uniform(0, 9, 50)
    odom = odometry(2 * S + 1, 1.5)
    odom.pose.pose.orientation.z, odom.pose.pose.orientation.w = math.sin(0.4), math.cos(0.4)
    odom.pose.pose.orientation.x = 0.01  # tilted a little
    odom.twist.twist.linear.x, odom.twist.twist.angular.z = 0.25, -0.5
    imu = make("sensor_msgs/msg/Imu", header=header(3 * S, "imu"))
    imu.angular_velocity.z = 0.125
    messages = [
        ("/scan", scan(S, ranges, "/laser_link", angle_increment=0.05, time_increment=0.001)),
        ("/odom", odom),
        ("/imu", imu),
        ("/tf", tf(transform(4 * S, "a", "b", (1, 2, 3), (0.5, 0.5, 0.5, 0.5)))),
        ("/wheels", joints(5 * S, ["arm", "left_wheel", "right_wheel_joint"], [9.0, 0.1, 0.25])),
        ("/servo", joints(6 * S, ["ir"], [0.3])),
        ("/range", ranger(7 * S, "/ir")),
    ]
    fast = events(write_mcap(tmp_path / "little.mcap", messages))
    general = events(write_mcap(tmp_path / "big.mcap", messages, little_endian=False))
    kinds = ["LaserScan", "Odometry", "Imu", "Transform", "WheelTicks", "Range"]
    assert [type(e).__name__ for e in fast] == kinds
    assert list(map(fingerprint, fast)) == list(map(fingerprint, general))
    assert fast[0].frame_id == "laser_link"
    assert fast[0].time_increment_s == np.float32(0.001)
    expected = math.atan2(2 * math.cos(0.4) * math.sin(0.4), math.cos(0.4) ** 2 + 0.0001 - math.sin(0.4) ** 2)
    assert fast[1].yaw_rad == pytest.approx(expected, abs=1e-12)


def test_a_schema_in_idl_is_understood(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "idl.mcap", [("/scan", scan(S)), ("/scan", scan(2 * S))], "ros2idl")
    assert [e.ranges_m.tolist() for e in events(path)] == [[1, 2, 3], [1, 2, 3]]


def test_only_the_standard_fields_take_the_fast_decoder() -> None:
    text = HUMBLE.generate_msgdef("sensor_msgs/msg/LaserScan", ros_version=2)[0]
    assert is_standard(Schema("sensor_msgs/msg/LaserScan", "ros2msg", text.encode()))
    assert is_standard(Schema("sensor_msgs/msg/LaserScan", "ros2msg", (text + "\n# a remark\n").encode()))
    swapped = text.replace("float32 angle_min", "float32 swap").replace(
        "float32 angle_max", "float32 angle_min"
    )
    assert not is_standard(Schema("sensor_msgs/msg/LaserScan", "ros2msg", swapped.encode()))
    later = HUMBLE.generate_msgdef("sensor_msgs/msg/Range", ros_version=2)[0]
    later = later.replace("float32 range\n", "float32 range\nfloat32 variance\n")
    assert is_standard(Schema("sensor_msgs/msg/Range", "ros2msg", later.encode()))
    assert not is_standard(
        Schema("sensor_msgs/msg/Range", "ros2msg", later.replace("variance", "other").encode())
    )
    seq = text.replace("string frame_id", "string frame_id\nuint32 seq")
    assert not is_standard(Schema("sensor_msgs/msg/LaserScan", "ros2msg", seq.encode()))


def test_a_schema_with_other_fields_is_decoded_by_what_it_says(tmp_path: Path) -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    text = HUMBLE.generate_msgdef("sensor_msgs/msg/LaserScan", ros_version=2)[0]
    text = text.replace("float32 angle_min", "float64 extra\nfloat32 angle_min", 1)
    store = get_typestore(Stores.EMPTY)
    builtin = {n: f for n, f in HUMBLE.fielddefs.items() if n.startswith("builtin_interfaces")}
    store.register({**builtin, **get_types_from_msg(text, "sensor_msgs/msg/LaserScan")})
    plain = scan(S)
    cls = store.types["sensor_msgs/msg/LaserScan"]
    fields = {n: getattr(plain, n) for n, _ in HUMBLE.fielddefs["sensor_msgs/msg/LaserScan"][1]}
    data = bytes(store.serialize_cdr(cls(extra=7.0, **fields), "sensor_msgs/msg/LaserScan"))
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", text.encode())
        writer.add_message(writer.register_channel("/scan", "cdr", schema), 0, data, 0)
        writer.finish()
    (event,) = events(path)
    assert isinstance(event, LaserScan)
    assert (event.angle_min_rad, event.ranges_m.tolist()) == (-1.0, [1, 2, 3])


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"ranges": ()}, "no_beams"),
        ({"angle_increment": 0.0}, "bad_angles"),
        ({"angle_increment": math.nan}, "bad_angles"),
        ({"angle_min": math.inf}, "bad_angles"),
        ({"angle_increment": 4.0}, "bad_angles"),  # three beams over 8 rad
        ({"range_max": math.nan}, "bad_range_limits"),
        ({"range_min": 5.0, "range_max": 4.0}, "bad_range_limits"),
        ({"range_min": 0.0, "range_max": 0.0}, "bad_range_limits"),
    ],
)
def test_a_scan_that_no_method_can_use_is_counted_by_its_reason(
    tmp_path: Path, fields: dict[str, Any], reason: str
) -> None:
    path = write_mcap(
        tmp_path / "a.mcap", [("/scan", scan(S)), ("/scan", scan(2 * S, **fields)), ("/scan", scan(3 * S))]
    )
    with open_log(path) as log:
        scans = [e for e in log.events() if isinstance(e, LaserScan)]
        assert [e.stamp_ns for e in scans] == [S, 3 * S]
        assert log.counters[f"skipped.scan.{reason}"] == 1
        assert "/scan message 2" in log.problems[-1]
        assert log.is_lossy


def test_ranges_that_are_no_numbers_or_out_of_range_are_kept_as_recorded(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", [("/scan", scan(S, (math.nan, math.inf, -1.0, 0.0, 1e30)))])
    (event,) = events(path)
    assert np.array_equal(
        event.ranges_m, np.array([math.nan, math.inf, -1, 0, 1e30], np.float32), equal_nan=True
    )
    assert not event.ranges_m.flags.writeable


def test_odometry_without_numbers_and_messages_without_stamps_are_counted(tmp_path: Path) -> None:
    bad = odometry(S, math.nan)
    negative = odometry(0)
    negative.header.stamp.sec = -5
    late = odometry(0)
    late.header.stamp.nanosec = 2 * 10**9
    path = write_mcap(tmp_path / "a.mcap", moving(bad, negative, late, odometry(2 * S)))
    with open_log(path) as log:
        assert [e.stamp_ns for e in log.events()] == [2 * S]
        assert log.counters["skipped.odom.not_finite"] == 1
        assert log.counters["skipped.odom.bad_stamp"] == 2


def test_a_message_that_is_cut_short_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    data = bytes(HUMBLE.serialize_cdr(scan(S), "sensor_msgs/msg/LaserScan"))
    text = HUMBLE.generate_msgdef("sensor_msgs/msg/LaserScan", ros_version=2)[0]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", text.encode())
        channel = writer.register_channel("/scan", "cdr", schema)
        for piece in (data, data[:40], data[:9], b"", data):
            writer.add_message(channel, 0, piece, 0)
        writer.finish()
    with open_log(path) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 2
        assert log.counters["skipped.scan.undecodable"] == 3


def test_streams_are_merged_by_stamp_with_odometry_before_the_scan_of_the_same_moment(tmp_path: Path) -> None:
    messages = moving(scan(S), scan(2 * S), odometry(2 * S), odometry(S), scan(3 * S), odometry(3 * S))
    path = write_mcap(tmp_path / "a.mcap", messages)
    seen = [(type(e).__name__, e.stamp_ns // S) for e in events(path)]
    # The recorded order of the odometry holds; its out-of-order stamp comes after all that have the stamp before it.
    assert seen == [
        ("LaserScan", 1),
        ("Odometry", 2),
        ("LaserScan", 2),
        ("Odometry", 1),
        ("Odometry", 3),
        ("LaserScan", 3),
    ]


def test_tf_static_becomes_one_transform_per_sensor_frame_in_use(tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    static = tf(
        transform(0, "base_link", "mast", (0.0, 0.0, 1.0), (half, 0, 0, half)),
        transform(0, "mast", "laser", (0.5, 0.0, 0.0), (0.0, 1.0, 0, 0)),
        transform(0, "base_link", "unused", (9.0, 9.0, 9.0)),
    )
    path = write_mcap(tmp_path / "a.mcap", [*moving(scan(5 * S), odometry(4 * S)), ("/tf_static", static)])
    with open_log(path, kinds=["scan", "odom"]) as log:
        first, *rest = log.events()
        assert not log.problems
    assert isinstance(first, Transform)
    assert (first.stamp_ns, first.frame_id, first.child_frame_id) == (4 * S, "base_link", "laser")
    assert first.translation_m == pytest.approx((0.0, 0.5, 1.0))
    assert first.quat_wxyz == pytest.approx((0.0, half, half, 0.0))
    assert not any(isinstance(e, Transform) for e in rest)


def test_extrinsics_that_are_repeated_on_tf_count_as_static_while_they_do_not_change(tmp_path: Path) -> None:
    fixed = [("/tf", tf(transform(i * S, "base_link", "laser", (0.25, 0, 0)))) for i in range(1, 4)]
    path = write_mcap(tmp_path / "a.mcap", [*moving(scan(S), odometry(S)), *fixed])
    with open_log(path, kinds=["scan", "odom"]) as log:
        (extrinsics,) = log.sensor_extrinsics
        assert extrinsics.translation_m == (0.25, 0.0, 0.0)
        assert not log.problems
    shaking = ("/tf", tf(transform(9 * S, "base_link", "laser", (0.75, 0, 0))))
    path = write_mcap(tmp_path / "b.mcap", [*moving(scan(S), odometry(S)), *fixed, shaking])
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert "laser sits on a joint that moves" in log.problems[0]


def test_odometry_may_come_from_tf_when_there_are_no_odometry_messages(tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    moves = [
        ("/tf", tf(transform(i * S, "odom", "base_link", (i, 0.5, 0), (half, 0, 0, half)))) for i in (1, 2)
    ]
    path = write_mcap(tmp_path / "a.mcap", [("/scan", scan(S)), *moves])
    with open_log(path, kinds=["scan", "odom"]) as log:
        require_streams(log, ["scan", "odom"])
        poses = [e for e in log.events() if isinstance(e, Odometry)]
    assert [(e.stamp_ns, e.x_m, e.y_m) for e in poses] == [(S, 1.0, 0.5), (2 * S, 2.0, 0.5)]
    assert poses[0].yaw_rad == pytest.approx(math.pi / 2)
    assert math.isnan(poses[0].vx_mps)


def test_two_candidates_without_a_choice_are_listed_with_the_line_to_write(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", [("/front", scan(S)), ("/rear", scan(S)), ("/odom", odometry(S))])
    with pytest.raises(
        ConfigError, match=r"2 scan streams: /front .*, /rear .*log: \{topics: \{scan: /front\}\}"
    ):
        open_log(path, kinds=["scan", "odom"])
    config = LogConfig.model_validate({"topics": {"scan": "/rear"}})
    with open_log(path, config, ["scan", "odom"]) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 1
        assert log.counters["unused.scan"] == 1
    with pytest.raises(
        ConfigError, match=r"log.topics.scan: the log has no scan stream '/left'; it has: /front, /rear"
    ):
        open_log(path, LogConfig.model_validate({"topics": {"scan": "/left"}}), ["scan"])
    # Nothing needs to be unique for a conversion
    assert sum(isinstance(e, LaserScan) for e in events(path)) == 2


def test_a_missing_stream_is_an_error_that_lists_what_there_is(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path / "a.mcap", [("/odom", odometry(S)), ("/tf", tf(transform(S, "map", "odom", (0, 0, 0))))]
    )
    with (
        open_log(path, kinds=["scan", "odom"]) as log,
        pytest.raises(
            LogError, match=r"no scan stream.*/tf \(map->odom\).*/odom .*log: \{topics: \{scan: TOPIC\}\}"
        ),
    ):
        require_streams(log, ["scan", "odom"])


def test_the_truth_is_never_among_the_events(tmp_path: Path) -> None:
    path = write_mcap(
        tmp_path / "a.mcap", [("/odom", odometry(S, 1.0)), ("/ground_truth", odometry(2 * S, 5.0))]
    )
    with open_log(path, kinds=["odom"]) as log:
        assert [e.x_m for e in log.events()] == [1.0]
        truth = log.truth()
    assert truth is not None
    assert truth.stamps_ns.tolist() == [2 * S]
    assert truth.poses.tolist() == [[5.0, 0.0, 0.0]]
    pose = make("geometry_msgs/msg/PoseStamped", header=header(3 * S, "map"))
    pose.pose.position.y, pose.pose.orientation.w = 4.0, 1.0
    path = write_mcap(tmp_path / "b.mcap", [("/odom", odometry(S)), ("/mocap", pose)])
    with open_log(path, LogConfig(truth="/mocap"), ["odom"]) as log:
        found = log.truth()
        assert found is not None
        assert found.poses.tolist() == [[0.0, 4.0, 0.0]]
    with pytest.raises(ConfigError, match=r"log.truth: .*'/gps'; it has /odom, /mocap"):
        open_log(path, LogConfig(truth="/gps"))


def test_the_truth_may_lie_beside_the_log(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "run.mcap", [("/odom", odometry(S))])
    with open_log(path) as log:
        assert log.truth() is None
    (tmp_path / "run.truth").mkdir()
    (tmp_path / "run.truth" / "trajectory.tum").write_text("# t x y z q\n1.5 1 2 0 0 0 1 0\n")
    with open_log(path) as log:
        truth = log.truth()
    assert truth is not None
    assert truth.stamps_ns.tolist() == [1_500_000_000]
    assert truth.poses[0].tolist() == pytest.approx([1.0, 2.0, math.pi])


def test_wheels_are_recognised_by_their_joints_names(tmp_path: Path) -> None:
    names = ["head_pan", "wheel_right_joint", "wheel_left_joint"]
    path = write_mcap(tmp_path / "a.mcap", [("/joint_states", joints(S, names, [9.0, 2.0, 1.0]))])
    (event,) = events(path)
    assert isinstance(event, WheelTicks)
    assert (event.left_rad, event.right_rad) == (1.0, 2.0)
    path = write_mcap(tmp_path / "b.mcap", [("/joint_states", joints(S, ["w1", "w2"], [3.0, 4.0]))])
    assert not events(path)
    config = LogConfig.model_validate({"wheels": {"left": "w2", "right": "w1"}})
    (event,) = events(path, config)
    assert (event.left_rad, event.right_rad) == (4.0, 3.0)


def joints(stamp: int, names: list[str], positions: list[float]) -> Any:
    return make("sensor_msgs/msg/JointState", header=header(stamp), name=names, position=np.array(positions))


def ranger(stamp: int, frame: str) -> Any:
    return make(
        "sensor_msgs/msg/Range", header=header(stamp, frame), min_range=0.1, max_range=1.5, range=0.75
    )


def test_a_rangers_bearing_is_its_servos_angle(tmp_path: Path) -> None:
    servo = make(
        "sensor_msgs/msg/JointState",
        header=header(S),
        name=["ir_left", "ir_right"],
        position=np.array([0.5, -0.5]),
    )
    rotated = tf(transform(2 * S, "mast", "ir_front", (0, 0, 0), (math.cos(0.2), 0, 0, math.sin(0.2))))
    messages = [
        ("/servo", servo),
        ("/tf", rotated),
        *(("/range", ranger(3 * S, f"ir_{n}")) for n in ("left", "right", "front")),
    ]
    found = events(write_mcap(tmp_path / "a.mcap", messages), kinds=("range",))
    assert [(e.frame_id, e.range_m) for e in found if isinstance(e, Range)] == [
        ("ir_left", 0.75),
        ("ir_right", 0.75),
        ("ir_front", 0.75),
    ]
    assert [e.bearing_rad for e in found] == pytest.approx([0.5, -0.5, 0.4])


def test_a_reading_before_its_servos_first_angle_is_counted_and_one_without_a_servo_looks_ahead(
    tmp_path: Path,
) -> None:
    servo = make(
        "sensor_msgs/msg/JointState", header=header(2 * S), name=["ir_left"], position=np.array([0.5])
    )
    messages = [
        ("/range", ranger(S, "ir_left")),
        ("/range", ranger(S, "ir_fixed")),
        ("/servo", servo),
        ("/range", ranger(3 * S, "ir_left")),
    ]
    path = write_mcap(tmp_path / "a.mcap", messages)
    with open_log(path, None, ("range",)) as log:
        found = [e for e in log.events() if isinstance(e, Range)]
        assert log.counters["skipped.range.no_servo_angle"] == 1
        assert not any("straight ahead" in line for line in log.problems)
    assert [(e.frame_id, e.bearing_rad) for e in found] == [("ir_fixed", 0.0), ("ir_left", 0.5)]


def test_servos_whose_names_fit_no_ranger_are_spoken_of(tmp_path: Path) -> None:
    """Otherwise all readings would point straight ahead, and the map would be wrong without a word."""
    servo = make("sensor_msgs/msg/JointState", header=header(S), name=["servo_1"], position=np.array([0.5]))
    path = write_mcap(tmp_path / "a.mcap", [("/servo", servo), ("/range", ranger(2 * S, "ir_left"))])
    with open_log(path, None, ("range",)) as log:
        assert len([e for e in log.events() if isinstance(e, Range)]) == 1
        (line,) = [p for p in log.problems if "straight ahead" in p]
    assert "ir_left" in line
    assert "servo_1" in line


def picture(encoding: str, rows: int, cols: int, step: int, data: bytes, bigendian: int = 0) -> Any:
    return make(
        "sensor_msgs/msg/Image",
        header=header(S, "cam"),
        height=rows,
        width=cols,
        encoding=encoding,
        step=step,
        is_bigendian=bigendian,
        data=np.frombuffer(data, np.uint8),
    )


def test_pixels_are_grey_or_rgb_whatever_the_encoding(tmp_path: Path) -> None:
    rgb = np.arange(12, dtype=np.uint8).reshape(1, 4, 3)
    padded = rgb.tobytes() + b"\xff\xff"  # rows may be longer than their pixels
    alpha = np.concatenate([rgb[:, :, ::-1], np.full((1, 4, 1), 9, np.uint8)], axis=2)
    for encoding, step, data in [
        ("rgb8", 14, padded),
        ("bgr8", 12, rgb[:, :, ::-1].tobytes()),
        ("bgra8", 16, alpha.tobytes()),
    ]:
        path = write_mcap(tmp_path / "a.mcap", [("/front/image_raw", picture(encoding, 1, 4, step, data))])
        (event,) = events(path)
        assert isinstance(event, Image)
        assert event.camera == "front"
        np.testing.assert_array_equal(event.pixels, rgb)


def test_depths_are_metres_with_nan_for_none(tmp_path: Path) -> None:
    millimetres = np.array([[0, 1500], [2000, 65535]], np.uint16)
    for order, bigendian in (("<", 0), (">", 1)):
        data = millimetres.astype(f"{order}u2").tobytes()
        path = write_mcap(
            tmp_path / "a.mcap", [("/cam/depth/image_raw", picture("16UC1", 2, 2, 4, data, bigendian))]
        )
        (event,) = events(path, kinds=("depth",))
        assert isinstance(event, DepthImage)
        expected = np.array([[math.nan, 1.5], [2.0, 65.535]], np.float32)
        np.testing.assert_array_equal(event.depth_m, expected)


def test_unknown_encodings_and_wrong_sizes_are_counted(tmp_path: Path) -> None:
    messages = [
        ("/cam/image", picture("mono8", 2, 2, 2, bytes(4))),
        ("/cam/image", picture("yuv411p", 2, 2, 4, bytes(8))),
        ("/cam/image", picture("mono8", 2000, 2000, 2000, bytes(4))),
    ]
    with open_log(write_mcap(tmp_path / "a.mcap", messages)) as log:
        assert sum(isinstance(e, Image) for e in log.events()) == 1
        assert log.counters["skipped.image.unknown_encoding"] == 1
        assert log.counters["skipped.image.undecodable"] == 1


def test_a_compressed_image_is_unpacked(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (4, 5, 3)).astype(np.uint8)
    buffer = io.BytesIO()
    Pillow.fromarray(pixels).save(buffer, "PNG")
    message = make(
        "sensor_msgs/msg/CompressedImage",
        header=header(S),
        format="png",
        data=np.frombuffer(buffer.getvalue(), np.uint8),
    )
    (event,) = events(write_mcap(tmp_path / "a.mcap", [("/cam/image_raw/compressed", message)]))
    np.testing.assert_array_equal(event.pixels, pixels)
    assert event.camera == "cam"


def test_disparities_below_the_minimum_are_no_match(tmp_path: Path) -> None:
    values = np.array([[1.0, 5.0], [math.inf, -1.0]], np.float32)
    message = make("stereo_msgs/msg/DisparityImage", header=header(S), f=500.0, t=0.25, min_disparity=2.0)
    message.image = picture("32FC1", 2, 2, 8, values.tobytes())
    (event,) = events(write_mcap(tmp_path / "a.mcap", [("/stereo/disparity", message)]))
    assert isinstance(event, Disparity)
    assert np.isnan(event.disparity_px).tolist() == [[True, False], [True, True]]
    assert (event.focal_px, event.baseline_m) == (500.0, 0.25)


def test_an_absolute_pose_keeps_the_planar_part_of_its_covariance(tmp_path: Path) -> None:
    message = make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header(S, "map"))
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = np.arange(36.0)
    (event,) = events(write_mcap(tmp_path / "a.mcap", [("/pose", message)]))
    assert isinstance(event, AbsolutePose)
    # rows and columns 0, 1, 5 are [[0, 1, 5], [6, 7, 11], [30, 31, 35]], made symmetric
    assert event.covariance.tolist() == [[0, 3.5, 17.5], [3.5, 7, 21], [17.5, 21, 35]]


def test_foxglove_json_is_read(tmp_path: Path) -> None:
    def time(seconds: int) -> dict[str, int]:
        return {"sec": seconds, "nsec": 5}

    pose = {"position": {"x": 1, "y": 2, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 1, "w": 0}}
    laser = {
        "timestamp": time(1),
        "frame_id": "laser",
        "pose": pose,
        "start_angle": -1.0,
        "end_angle": 1.0,
        "ranges": [1.0, None, 3.0],
        "intensities": [],
    }
    sensor_extrinsics = {
        "timestamp": time(0),
        "parent_frame_id": "base_link",
        "child_frame_id": "laser",
        "translation": {"x": 0.5, "y": 0, "z": 0},
        "rotation": {"x": 0, "y": 0, "z": 0, "w": 1},
    }
    raw = {
        "timestamp": time(3),
        "frame_id": "cam",
        "width": 2,
        "height": 1,
        "encoding": "rgb8",
        "step": 6,
        "data": base64.b64encode(bytes(range(6))).decode(),
    }
    calibration = {
        "timestamp": time(3),
        "frame_id": "cam",
        "width": 2,
        "height": 1,
        "D": [0.5],
        "K": [1.0] * 9,
    }
    path = write_json(
        tmp_path / "a.mcap",
        [
            ("/scan", "foxglove.LaserScan", laser),
            ("/odom", "foxglove.PoseInFrame", {"timestamp": time(2), "frame_id": "odom", "pose": pose}),
            ("/tf_static", "foxglove.FrameTransforms", {"transforms": [sensor_extrinsics]}),
            ("/cam/image", "foxglove.RawImage", raw),
            ("/cam/calibration", "foxglove.CameraCalibration", {**calibration, "P": [2.0] * 12}),
        ],
    )
    with open_log(path) as log:
        extrinsics = {m.child_frame_id: m.translation_m for m in log.sensor_extrinsics}
        scan_event, pose_event, info, image = [e for e in log.events() if not isinstance(e, Transform)]
    assert extrinsics == {"laser": (0.5, 0.0, 0.0), "cam": (0.0, 0.0, 0.0)}
    assert isinstance(scan_event, LaserScan)
    assert (scan_event.angle_min_rad, scan_event.angle_increment_rad) == (-1.0, 1.0)
    assert scan_event.stamp_ns == S + 5
    assert np.array_equal(scan_event.ranges_m, np.array([1, np.nan, 3], np.float32), equal_nan=True)
    assert isinstance(pose_event, Odometry)
    assert (pose_event.x_m, pose_event.y_m) == (1.0, 2.0)
    assert pose_event.yaw_rad == pytest.approx(math.pi)
    assert isinstance(info, CameraInfo)
    assert (info.camera, info.D.tolist()) == ("cam", [0.5])
    assert isinstance(image, Image)
    assert image.pixels.tolist() == [[[0, 1, 2], [3, 4, 5]]]


def test_ros_messages_in_json_are_read(tmp_path: Path) -> None:
    head = {"stamp": {"sec": 7, "nanosec": 9}, "frame_id": "laser"}
    document = {
        "header": head,
        "angle_min": -1.0,
        "angle_max": 1.0,
        "angle_increment": 0.5,
        "time_increment": 0.0,
        "scan_time": 0.0,
        "range_min": 0.0,
        "range_max": 9.0,
        "ranges": [1.5, 2.5],
        "intensities": [],
    }
    path = write_json(
        tmp_path / "a.mcap", [("/scan", "sensor_msgs/msg/LaserScan", document), ("/scan", "x", {"no": 1})]
    )
    with open_log(path) as log:
        (event,) = [e for e in log.events() if isinstance(e, LaserScan)]
        assert log.counters["skipped.scan.undecodable"] == 1
    assert (event.stamp_ns, event.ranges_m.tolist()) == (7 * S + 9, [1.5, 2.5])


def test_a_tf_stream_may_be_named_as_the_odometry(tmp_path: Path) -> None:
    moves = [("/tf", tf(transform(i * S, "world", "base_link", (i, 0, 0)))) for i in (1, 2)]
    path = write_mcap(tmp_path / "a.mcap", [("/odom", odometry(S, 9.0)), *moves])
    config = LogConfig.model_validate({"topics": {"odom": "world->base_link"}})
    assert [e.x_m for e in events(path, config, ("odom",))] == [1.0, 2.0]


def test_disorder_is_said_and_is_no_loss(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", moving(scan(2 * S), scan(S), scan(S), odometry(S)))
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert log.counters["out_of_order.scan"] == 1
        assert log.counters["equal_stamps.scan"] == 1
        assert any("/scan: 1 out-of-order stamps" in line for line in log.problems)
        assert not log.is_lossy


def test_a_outlier_stamp_is_skipped_and_counted(tmp_path: Path) -> None:
    stamps = [1, 2, 100_000, 3, 4]
    path = write_mcap(tmp_path / "a.mcap", moving(*(scan(t * S) for t in stamps)))
    with open_log(path) as log:
        assert [e.stamp_ns // S for e in log.events() if isinstance(e, LaserScan)] == [1, 2, 3, 4]
        assert log.counters["skipped.scan.outlier_stamp"] == 1
        assert any("/scan message 3" in line for line in log.problems)


def test_names_with_control_characters_are_kept_and_shown_escaped(tmp_path: Path, program: Program) -> None:
    path = write_mcap(tmp_path / "a.mcap", [("/\x1b[2Jscan\n", scan(S, frame="la\x07ser\u202e"))])
    with open_log(path) as log:
        assert (log.streams[0].topic, log.streams[0].frame) == ("/\x1b[2Jscan\n", "la\x07ser\u202e")
    for options in ([], ["--json"]):
        shown = program("info", path, *options)
        assert shown.returncode == 0
        assert all(line.isprintable() for text in (shown.stdout, shown.stderr) for line in text.split("\n"))
    assert "la\\x07ser\\u202e" in program("info", path).stderr


def test_memory_for_early_messages_is_bounded_and_what_comes_late_is_said(tmp_path: Path) -> None:
    big = np.zeros((1000, 1000, 3), np.uint8).tobytes()
    pictures = []
    for i in range(2, 6):
        message = picture("rgb8", 1000, 1000, 3000, big)
        message.header = header(i * S, "cam")
        pictures.append(("/cam/image", message))
    path = write_mcap(tmp_path / "a.mcap", [*pictures, ("/odom", odometry(S))])
    small = LogConfig.model_validate({"limits": {"reorder_mb": 6}})
    with open_log(path, small) as log:
        kinds = [type(e).__name__ for e in log.events() if not isinstance(e, Transform)]
        assert sorted(kinds) == ["Image"] * 4 + ["Odometry"]
        assert log.counters["late.odom"] == 1
        assert any("reorder_mb" in line for line in log.problems)
    assert type(events(path)[0]).__name__ == "Odometry"


def test_what_is_wrong_with_streams_nobody_asked_for_is_no_loss(tmp_path: Path) -> None:
    undated = picture("mono8", 1, 1, 1, b"\0")
    undated.header.stamp.sec = -1
    path = write_mcap(tmp_path / "a.mcap", [("/cam/image", undated), *moving(scan(S), odometry(S))])
    with open_log(path, kinds=["scan", "odom"]) as log:
        assert len(list(log.events())) == 3
        assert not log.is_lossy
        assert "skipped.image.bad_stamp" not in log.counters
    with open_log(path) as log:
        assert log.counters["skipped.image.bad_stamp"] == 1


def test_an_absolute_pose_may_be_the_truth_and_is_converted_as_such(tmp_path: Path) -> None:
    message = make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header(S, "map"))
    message.pose.pose.orientation.w, message.pose.pose.position.x = 1.0, 3.0
    path = write_mcap(tmp_path / "a.mcap", [("/mocap", message), ("/odom", odometry(S))])
    for name in ("b.mcap", "b"):
        with open_log(path, LogConfig(truth="/mocap")) as log:
            convert_log(log, tmp_path / name)
        with open_log(tmp_path / name, kinds=["odom"]) as log:
            truth = log.truth()
            assert truth is not None
            assert truth.poses.tolist() == [[3.0, 0.0, 0.0]]
            assert sum(isinstance(e, Odometry) for e in log.events()) == 1


def test_a_recording_played_in_a_loop_keeps_each_scan_beside_its_odometry_and_is_noted(
    tmp_path: Path,
) -> None:
    messages = [m for _ in range(3) for i in range(1, 9) for m in (odometry(i * S), scan(i * S))]
    path = write_mcap(tmp_path / "a.mcap", moving(*messages))
    with open_log(path) as log:
        kinds = [type(e).__name__ for e in log.events() if isinstance(e, Odometry | LaserScan)]
        assert kinds == ["Odometry", "LaserScan"] * 24
        assert log.counters["clock_jumps"] == 2
        assert any("set back 2 times" in line for line in log.problems)
