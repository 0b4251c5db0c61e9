"""Foxglove messages in protobuf, in MCAP files that a test encodes by hand."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.writer import Writer

from gridslam.core.messages import LaserScan, Odometry
from gridslam.logs import open_log

DOUBLE, STRING, MESSAGE, SINT64, UINT32 = 1, 9, 11, 18, 13
TIMESTAMP = ".google.protobuf.Timestamp"


def varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])


def block(number: int, data: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(data)) + data


def integer(number: int, value: int) -> bytes:
    return varint(number << 3) + varint(value)


def double(number: int, value: float) -> bytes:
    return varint(number << 3 | 1) + struct.pack("<d", value)


def described(name: str, *fields: tuple[str, int, int, str, bool]) -> bytes:
    """A DescriptorProto; of each field the name, number, type, message type, and whether it is repeated."""
    data = block(1, name.encode())
    for field, number, kind, message, is_repeated in fields:
        body = (
            block(1, field.encode())
            + integer(3, number)
            + integer(4, 3 if is_repeated else 1)
            + integer(5, kind)
        )
        data += block(2, body + (block(6, message.encode()) if message else b""))
    return block(4, data)


def numbers(*names: str) -> list[tuple[str, int, int, str, bool]]:
    return [(name, place, DOUBLE, "", False) for place, name in enumerate(names, 1)]


SCHEMA = block(
    1,
    block(2, b"foxglove")
    + described("Vector3", *numbers("x", "y", "z"))
    + described("Quaternion", *numbers("x", "y", "z", "w"))
    + described(
        "Pose",
        ("position", 1, MESSAGE, ".foxglove.Vector3", False),
        ("orientation", 2, MESSAGE, ".foxglove.Quaternion", False),
    )
    + described(
        "PoseInFrame",
        ("timestamp", 1, MESSAGE, TIMESTAMP, False),
        ("frame_id", 2, STRING, "", False),
        ("pose", 3, MESSAGE, ".foxglove.Pose", False),
    )
    + described(
        "LaserScan",
        ("timestamp", 1, MESSAGE, TIMESTAMP, False),
        ("frame_id", 2, STRING, "", False),
        ("pose", 3, MESSAGE, ".foxglove.Pose", False),
        ("start_angle", 4, DOUBLE, "", False),
        ("end_angle", 5, DOUBLE, "", False),
        ("ranges", 6, DOUBLE, "", True),
        ("intensities", 7, DOUBLE, "", True),
    ),
)


def stamp(second: int) -> bytes:
    return block(1, integer(1, second) + integer(2, 500))


def scan(second: int) -> bytes:
    ranges = struct.pack("<3d", 1.0, 2.0, 3.0)
    return stamp(second) + block(2, b"laser") + double(4, -1.0) + double(5, 1.0) + block(6, ranges)


def pose(second: int) -> bytes:
    position, orientation = double(1, 4.0) + double(2, -5.0), double(4, 1.0)
    return stamp(second) + block(2, b"odom") + block(3, block(1, position) + block(2, orientation))


def recording(path: Path, schema: bytes = SCHEMA, cut: int = 0) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, name, message in (("/scan", "LaserScan", scan), ("/pose", "PoseInFrame", pose)):
            definition = writer.register_schema(f"foxglove.{name}", "protobuf", schema)
            channel = writer.register_channel(topic, "protobuf", definition)
            for second in range(1, 4):
                data = message(second)
                writer.add_message(channel, second, data[: len(data) - cut], second)
        writer.finish()
    return path


def test_scans_and_odometry_in_protobuf_are_read(tmp_path: Path) -> None:
    with open_log(recording(tmp_path / "a.mcap"), kinds=["scan", "odom"]) as log:
        scans = [e for e in log.events() if isinstance(e, LaserScan)]
        odometry = [e for e in log.events() if isinstance(e, Odometry)]
        assert not log.is_lossy, log.problems
    assert [s.stamp_ns for s in scans] == [i * 10**9 + 500 for i in range(1, 4)]
    assert scans[0].ranges_m.tolist() == [1.0, 2.0, 3.0]
    assert (scans[0].angle_min_rad, scans[0].angle_increment_rad) == (-1.0, 1.0)
    assert (odometry[0].x_m, odometry[0].y_m, odometry[0].yaw_rad) == (4.0, -5.0, 0.0)


@pytest.mark.parametrize("schema", [b"", b"\xff" * 20, SCHEMA[: len(SCHEMA) // 2]])
def test_a_channel_without_a_readable_definition_is_counted(tmp_path: Path, schema: bytes) -> None:
    with open_log(recording(tmp_path / "a.mcap", schema)) as log:
        assert not list(log.events())
        assert log.counters["skipped.scan.unreadable_schema"] == 3


def test_a_cut_message_is_counted(tmp_path: Path) -> None:
    with open_log(recording(tmp_path / "a.mcap", cut=3)) as log:
        assert not list(log.events())
        assert log.counters["skipped.scan.undecodable"] == 3
