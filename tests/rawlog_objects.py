"""Objects of MRPT rawlogs as bytes, in the versions that the reader knows."""

from __future__ import annotations

import math
import struct

import numpy as np


def object_of(name: str, version: int, body: bytes) -> bytes:
    return bytes([len(name) | 0x80]) + name.encode() + bytes([version]) + body + b"\x88"


def ticks(stamp_ns: int) -> bytes:
    return struct.pack("<Q", stamp_ns // 100 + 116_444_736_000_000_000)


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def pose_3d(x: float, yaw: float) -> bytes:
    return object_of(
        "CPose3D", 2, struct.pack("<7d", x, 0.0, 0.3, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
    )


def pose_2d(x: float, y: float, yaw: float, space: str = "") -> bytes:
    return object_of(f"{space}CPose2D", 1, struct.pack("<3d", x, y, yaw))


def scan_of(
    stamp_ns: int, version: int = 7, label: str = "HOKUYO", to_left: bool = True, space: str = ""
) -> bytes:
    ranges = np.array([1.0, 2.0, 0.0, 30.0, 3.0], "<f4")
    body = struct.pack("<fBf", math.pi, to_left, 30.0) + pose_3d(0.2, 0.5)
    if version < 6:
        body += object_of("CMatrix", 0, struct.pack("<2I", 6, 6) + bytes(4 * 36))
    body += struct.pack("<I", 5) + ranges.tobytes() + bytes([1, 1, 0, 0, 1])
    body += struct.pack("<f", 0.01) + ticks(stamp_ns) + struct.pack("<f", 0.004) * (version >= 4)
    if version >= 5:
        body += text(label) + struct.pack("<d", 0.0)
    if version >= 7:
        body += b"\1" + np.arange(5, dtype="<i4").tobytes()
    if version >= 8:
        body += struct.pack("<f", 0.04)
    return object_of(f"{space}CObservation2DRangeScan", version, body)


def odometry_of(stamp_ns: int, x: float, yaw: float, space: str = "") -> bytes:
    body = pose_2d(x, 0.0, yaw) + text("ODO") + ticks(stamp_ns) + b"\0\0"
    return object_of(f"{space}CObservationOdometry", 2, body)


def action_of(x: float, yaw: float, version: int, stamp_ns: int = 0) -> bytes:
    body = struct.pack("<I", 0) + pose_2d(x, 0.0, yaw) + struct.pack("<I6fI", 0, *(0.1,) * 6, 300)
    body += struct.pack("<f", 0.1) * (4 if version == 4 else 6) + b"\0"
    body += bytes(8) * (version < 7) + b"\0" + bytes(8) * (version < 7)
    body += (ticks(stamp_ns) if stamp_ns else bytes(8)) * (version >= 6)
    action = object_of("CActionRobotMovement2D", version, body)
    return object_of("CActionCollection", 0, struct.pack("<I", 1) + action)


def frame_of(*observations: bytes) -> bytes:
    return object_of("CSensoryFrame", 2, struct.pack("<I", len(observations)) + b"".join(observations))
