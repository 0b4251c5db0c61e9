"""What drivers of lidars record beside LaserScan and PointCloud2: several echoes of a beam, the points of Livox."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from gridslam.core.messages import Event, LaserScan, PointCloud
from gridslam.logs import open_log
from tests.logs.ros_samples import header, make, write_mcap

NS = 10**9
POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
CUSTOM = "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
# The second is no return
POINTS = [
    (0, 1.0, 2.0, 0.5),
    (1_000_000, 0.0, 0.0, 0.0),
    (2_000_000, -3.0, 0.0, 0.25),
]


def livox(package: str, edition: Stores) -> tuple[Any, Any]:
    """A store of types with those of the driver, and one of its messages."""
    store = get_typestore(edition)
    name = f"{package}/msg/CustomMsg"
    store.register(get_types_from_msg(POINT, f"{package}/msg/CustomPoint"))
    store.register(get_types_from_msg(CUSTOM, name))
    point_type = store.types[f"{package}/msg/CustomPoint"]
    points = [point_type(t, x, y, z, reflectivity=9, tag=0, line=0) for t, x, y, z in POINTS]
    seq = (7,) if edition is Stores.ROS1_NOETIC else ()
    stamp = store.types["builtin_interfaces/msg/Time"](5, 0)
    head = store.types["std_msgs/msg/Header"](*seq, stamp, "livox_frame")
    rsvd = np.zeros(3, np.uint8)
    return store, store.types[name](head, 5 * NS, len(points), lidar_id=0, rsvd=rsvd, points=points)


def events(path: Path) -> list[Event]:
    with open_log(path) as log:
        assert not log.problems or not any("skipped" in line for line in log.problems)
        return list(log.events())


def check_cloud(path: Path) -> None:
    (cloud,) = [event for event in events(path) if isinstance(event, PointCloud)]
    assert (cloud.stamp_ns, cloud.frame_id) == (5 * NS, "livox_frame")
    np.testing.assert_allclose(cloud.points_m, [[1.0, 2.0, 0.5], [-3.0, 0.0, 0.25]])
    np.testing.assert_allclose(cloud.times_s, [0.0, 0.002])


@pytest.mark.parametrize("package", ["livox_ros_driver", "livox_ros_driver2"])
def test_the_points_of_livox_are_read_by_the_schema_in_the_log(tmp_path: Path, package: str) -> None:
    store, message = livox(package, Stores.ROS2_HUMBLE)
    kind = message.__msgtype__
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        text = store.generate_msgdef(kind, ros_version=2)[0]
        schema = writer.register_schema(kind, "ros2msg", text.encode())
        channel = writer.register_channel("/livox/lidar", "cdr", schema)
        writer.add_message(channel, 1, bytes(store.serialize_cdr(message, kind)), 1)
        writer.finish()
    check_cloud(tmp_path / "a.mcap")


def test_the_points_of_livox_are_read_from_a_ros1_bag(tmp_path: Path) -> None:
    store, message = livox("livox_ros_driver", Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "a.bag") as writer:
        connection = writer.add_connection("/livox/lidar", message.__msgtype__, typestore=store)
        writer.write(connection, 1, store.serialize_ros1(message, message.__msgtype__))
    check_cloud(tmp_path / "a.bag")


@pytest.mark.parametrize(("has_intensities", "expected"), [(True, 4.0), (False, 2.0)])
def test_the_strongest_echo_is_used_or_the_first(
    tmp_path: Path, has_intensities: bool, expected: float
) -> None:
    def echoes(*values: float) -> Any:
        return make("sensor_msgs/msg/LaserEcho", echoes=np.array(values, np.float32))

    message = make(
        "sensor_msgs/msg/MultiEchoLaserScan",
        header=header(5 * NS, "laser"),
        angle_min=-1.0, angle_max=1.0, angle_increment=1.0, range_min=0.1, range_max=30.0,
        ranges=[echoes(2.0, 4.0), echoes(), echoes(3.0)],
        intensities=[echoes(10.0, 50.0), echoes(), echoes(1.0)] if has_intensities else [],
    )  # fmt: skip
    path = write_mcap(tmp_path / "a.mcap", [("/echoes", message)])
    (scan,) = [event for event in events(path) if isinstance(event, LaserScan)]
    np.testing.assert_array_equal(scan.ranges_m, [expected, np.inf, 3.0])
    assert (scan.angle_min_rad, scan.range_max_m) == (-1.0, 30.0)
