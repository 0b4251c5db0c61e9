"""Objects of MRPT's rawlogs: how they are found in the bytes of a file, and what is read of them.

https://docs.mrpt.org/reference/latest/robotics_file_formats.html. An object is a byte with the length of its class's name and
the highest bit set, the name, a byte with its version, its fields, and 0x88. Objects lie within actions and sensory frames, or
one after the other. They are found by their names wherever they lie, so that objects of other classes are passed over.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import quaternion_of_matrix
from gridslam.core.messages import LaserScan, as_float32, readonly
from gridslam.core.stamps import END_NS
from gridslam.logs.rotations import Quaternion, Vector

Floats = NDArray[np.float64]

NAME = re.compile(rb"[\x80-\xff](?:mrpt::\w+::)?(C(?:Observation|Action)\w+)")
END_FLAG = 0x88
TICK_NS, EPOCH_TICKS = 100, 116_444_736_000_000_000  # stamps count from the year 1601
BY_ODOMETRY = 0  # an action's estimate: the wheels' increment, not a distribution


class ObjectFields:
    """Reads the fields of objects in order. Raises ValueError or struct.error: the bytes are not such an object."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at

    def take(self, form: str) -> tuple[float, ...]:
        """The values of a struct."""
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values

    def whole(self, form: str = "I") -> int:
        """One integer."""
        return int(self.take(form)[0])

    def array(self, kind: str, count: int) -> NDArray[np.generic]:
        """Many values of a numpy type."""
        found = np.frombuffer(self.data, kind, count, self.at)
        self.at += found.nbytes
        return found

    def text(self) -> str:
        """A text with its length before it."""
        return bytes(self.array("u1", self.whole())).decode("utf-8", "replace").partition("\0")[0]

    def head(self) -> tuple[bytes, int]:
        """The class and the version of an object that begins here."""
        length = self.whole("B") & 0x7F
        name = bytes(self.array("u1", length)).rpartition(b":")[2]
        return name, self.whole("B")

    def end(self) -> None:
        """The end of an object."""
        if self.whole("B") != END_FLAG:
            raise ValueError("no end of the object")

    def planar_pose(self) -> Floats:
        """A CPose2D `(3,)`."""
        name, version = self.head()
        if name != b"CPose2D" or version > 1:
            raise ValueError("no CPose2D")
        pose = np.array(self.take("3d" if version else "3f"), np.float64)
        self.end()
        return pose

    def pose(self) -> tuple[Vector, Quaternion]:
        """A CPose3D."""
        name, version = self.head()
        if name != b"CPose3D" or version > 2:
            raise ValueError("no CPose3D")
        if version == 2:
            x, y, z, qw, qx, qy, qz = self.take("7d")
        else:
            matrix = self.matrix()
            if matrix.shape != (4, 4):
                raise ValueError("no homogeneous matrix")
            x, y, z = matrix[:3, 3].tolist()
            qw, qx, qy, qz = quaternion_of_matrix(matrix[:3, :3])
        self.end()
        return (x, y, z), (qw, qx, qy, qz)

    def matrix(self) -> Floats:
        """A CMatrix or CMatrixD."""
        name, _ = self.head()
        rows, columns = self.whole(), self.whole()
        if name not in (b"CMatrix", b"CMatrixD") or rows * columns > 64:
            raise ValueError("no small matrix")
        kind = "<f4" if name == b"CMatrix" else "<f8"
        found = np.asarray(self.array(kind, rows * columns), np.float64).reshape(rows, columns)
        self.end()
        return found


@dataclass(frozen=True, slots=True)
class RecordedScan:
    """A CObservation2DRangeScan: its sensor's label and place on the robot, and the scan."""

    label: str
    place: tuple[Vector, Quaternion]
    scan: LaserScan


@dataclass(frozen=True, slots=True)
class RecordedMotion:
    """A pose `(3,)` by odometry, or the increment of one, and its stamp (0: none)."""

    stamp_ns: int
    pose: Floats


def objects_in(data: bytes) -> Iterator[tuple[str, int, int]]:
    """(class, place of its first field, version) of each observation and action."""
    for match in NAME.finditer(data):
        end = match.start() + 1 + (data[match.start()] & 0x7F)
        if match.start(1) < end <= match.end() and end < len(data):
            yield data[match.start(1) : end].decode("latin-1"), end + 1, data[end]


def read_scan(fields: ObjectFields, version: int) -> RecordedScan:
    """A CObservation2DRangeScan. Raises ValueError or struct.error: the bytes are none of a known version."""
    if version > 8:
        raise ValueError(f"version {version}")
    aperture, is_right_to_left, max_range = fields.take("fBf")
    place = fields.pose()
    if version < 6:
        fields.matrix()
    count = fields.whole()
    ranges = np.asarray(fields.array("<f4", count))
    is_valid = fields.array("u1", count) != 0 if version >= 1 else ranges < max_range
    if version >= 2:
        fields.take("f")  # standard deviation
    stamp_ns = _stamp_ns(fields.whole("Q")) if version >= 3 else 0
    label, sweep_s = "", 0.0
    if version >= 4:
        fields.take("f")  # aperture of a beam
    if version >= 5:
        label = fields.text()
        fields.take("d")  # change of pitch
    if version >= 7 and fields.whole("B"):
        fields.array("<i4", count)
    if version >= 8:
        (sweep_s,) = fields.take("f")
    fields.end()
    no_return = np.where(ranges >= max_range, np.inf, np.nan)
    step = aperture / max(count - 1, 1) * (1.0 if is_right_to_left else -1.0)
    return RecordedScan(
        label or "laser",
        place,
        LaserScan(
            stamp_ns,
            label or "laser",
            readonly(np.where(is_valid, ranges, no_return), np.float32),
            angle_min_rad=as_float32(-0.5 * step * max(count - 1, 1)),
            angle_increment_rad=as_float32(step),
            range_min_m=0.0,
            range_max_m=as_float32(max_range),
            time_increment_s=as_float32(sweep_s / max(count - 1, 1)),
        ),
    )


def _odometry(fields: ObjectFields, version: int) -> RecordedMotion:
    if version > 2:
        raise ValueError(f"version {version}")
    pose = fields.planar_pose()
    fields.text()
    return RecordedMotion(_stamp_ns(fields.whole("Q")), pose)


def _action(fields: ObjectFields, version: int) -> RecordedMotion:
    """The increment by odometry."""
    if not 4 <= version <= 7 or fields.whole() != BY_ODOMETRY:
        raise ValueError(f"version {version}, or no increment of odometry")
    increment = fields.planar_pose()
    fields.take(f"I6fI{4 if version == 4 else 6}f")  # the motion model
    has_velocities = fields.whole("B")
    if version < 7:
        fields.take("2f")
    elif has_velocities:
        fields.take("3d")
    if fields.whole("B") or version < 7:
        fields.take("2i")
    stamp_ns = _stamp_ns(fields.whole("Q")) if version >= 6 else 0
    fields.end()
    return RecordedMotion(stamp_ns, increment)


READERS: Mapping[str, Callable[[ObjectFields, int], RecordedScan | RecordedMotion]] = MappingProxyType(
    {
        "CObservation2DRangeScan": read_scan,
        "CObservationOdometry": _odometry,
        "CActionRobotMovement2D": _action,
    }
)


def _stamp_ns(ticks: int) -> int:
    """Nanoseconds since 1970; 0 for a stamp that was never set."""
    stamp_ns = (ticks - EPOCH_TICKS) * TICK_NS
    return stamp_ns if 0 < stamp_ns < END_NS else 0
