"""A rawlog of MRPT: scans of 2-D lidars and the robot's odometry, plain or packed with gzip.

https://docs.mrpt.org/reference/latest/robotics_file_formats.html. An object is a byte with the length of its class's name and
the highest bit set, the name, a byte with its version, its fields, and 0x88. Objects lie within actions and sensory frames, or
one after the other. They are found by their names wherever they lie, so that objects of other classes are passed over.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import LogError
from gridslam.core.messages import LaserScan, Odometry, Transform, as_float32, canonical_yaw, readonly
from gridslam.core.stamps import END_NS
from gridslam.logs.datasets.source import BASE_FRAME, DatasetSource, DatasetStream
from gridslam.logs.rotations import Quaternion, Vector, normalise
from gridslam.logs.text import open_ahead, packing_of

Floats = NDArray[np.float64]

NAME = re.compile(rb"[\x80-\xff](?:mrpt::\w+::)?(C(?:Observation|Action)\w+)")
END_FLAG = 0x88
TICK_NS, EPOCH_TICKS = 100, 116_444_736_000_000_000  # stamps count from the year 1601
MAX_BYTES = 2 << 30  # unpacked; larger ones would not fit in the memory of small machines
MAX_EXPANSION, ALWAYS_UNPACKED_BYTES = 100, 4 << 20  # of a packed file, against bombs
BY_ODOMETRY = 0  # an action's estimate: the wheels' increment, not a distribution
MAX_SAME_PLACE = 1e-3  # m and quaternion: a sensor whose place differs by more moves on the robot


class _Fields:
    """Reads the fields of objects in order. Raises ValueError or struct.error: the bytes are no such object."""

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
            x, y, z, qw, qx, qy, qz = _of_matrix(self.matrix())
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
class _Scan:
    """A CObservation2DRangeScan: its sensor's label and place on the robot, and the scan."""

    label: str
    place: tuple[Vector, Quaternion]
    scan: LaserScan


@dataclass(frozen=True, slots=True)
class _Motion:
    """A pose `(3,)` by odometry, or the increment of one, and its stamp (0: none)."""

    stamp_ns: int
    pose: Floats


def is_rawlog(beginning: bytes) -> bool:
    """Whether the first unpacked bytes of a file are those of an object of a rawlog."""
    return (
        re.match(rb"[\x80-\xff](?:mrpt::\w+::)?C(Observation\w+|ActionCollection|SensoryFrame)", beginning)
        is not None
    )


def open_rawlog(path: Path) -> DatasetSource:
    """The scans of each lidar, the odometry, and the lidars' extrinsics. Raises LogError: there is no scan, or too much."""
    data = _unpacked(path)
    scans: dict[str, list[tuple[int, int]]] = {}  # of each label, stamp and place in the file
    places: dict[str, tuple[Vector, Quaternion]] = {}
    moving: set[str] = set()
    odometry: list[_Motion] = []
    actions: list[tuple[int, _Motion]] = []  # with the number of scans before
    order: list[int] = []  # stamps of all scans
    others: Counter[str] = Counter()
    damaged: list[str] = []
    for name, at, version in _objects(data):
        reader = _READERS.get(name)
        if reader is None:
            others[name] += 1
            continue
        try:
            found = reader(_Fields(data, at), version)
        except (ValueError, struct.error) as error:
            damaged.append(f"{name} at byte {at} ({error})")
            continue
        if isinstance(found, _Scan):
            stamp_ns = found.scan.stamp_ns
            scans.setdefault(found.label, []).append((stamp_ns, at))
            order.append(stamp_ns)
            if not _is_same(places.setdefault(found.label, found.place), found.place):
                moving.add(found.label)
        elif name == "CObservationOdometry":
            odometry.append(found)
        else:
            actions.append((len(order), found))
    if not scans:
        raise LogError(f"{path}: a rawlog without scans of a 2-D lidar that could be read")
    if not odometry:
        odometry = _summed(actions, order)
    streams = [_scan_stream(data, label, found) for label, found in scans.items()]
    if odometry:
        streams.append(_odometry_stream(odometry))
    edges = [Transform(0, BASE_FRAME, label, *place, is_static=True) for label, place in places.items()]
    source = DatasetSource("MRPT rawlog", streams, edges, [path], _notes(others, moving))
    source.compression = packing_of(path)
    for place in damaged:
        source.message_counts.skip("unknown", "undecodable", place)
    return source


def _unpacked(path: Path) -> bytes:
    limit = path.stat().st_size
    if packing_of(path) != "none":
        limit = max(ALWAYS_UNPACKED_BYTES, MAX_EXPANSION * limit)
    try:
        with open_ahead(path) as stream:
            data = stream.read(min(limit, MAX_BYTES) + 1)
    except (OSError, EOFError) as error:
        raise LogError(
            f"{path}: a damaged packed rawlog ({error}); unpack what is left of it with gunzip"
        ) from None
    if len(data) > min(limit, MAX_BYTES):
        raise LogError(
            f"{path}: a rawlog of more than {min(limit, MAX_BYTES) >> 20} MiB; cut it with rawlog-edit"
        )
    return data


def _objects(data: bytes) -> Iterator[tuple[str, int, int]]:
    """(class, place of its first field, version) of each observation and action."""
    for match in NAME.finditer(data):
        end = match.start() + 1 + (data[match.start()] & 0x7F)
        if match.start(1) < end <= match.end() and end < len(data):
            yield data[match.start(1) : end].decode("latin-1"), end + 1, data[end]


def _scan(fields: _Fields, version: int) -> _Scan:
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
    return _Scan(
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


def _odometry(fields: _Fields, version: int) -> _Motion:
    if version > 2:
        raise ValueError(f"version {version}")
    pose = fields.planar_pose()
    fields.text()
    return _Motion(_stamp_ns(fields.whole("Q")), pose)


def _action(fields: _Fields, version: int) -> _Motion:
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
    return _Motion(stamp_ns, increment)


_READERS: Mapping[str, Callable[[_Fields, int], _Scan | _Motion]] = MappingProxyType(
    {"CObservation2DRangeScan": _scan, "CObservationOdometry": _odometry, "CActionRobotMovement2D": _action}
)


def _stamp_ns(ticks: int) -> int:
    """Nanoseconds since 1970; 0 for a stamp that was never set."""
    stamp_ns = (ticks - EPOCH_TICKS) * TICK_NS
    return stamp_ns if 0 < stamp_ns < END_NS else 0


def _summed(actions: list[tuple[int, _Motion]], scan_stamps: list[int]) -> list[_Motion]:
    """Poses by the increments of actions; those without a stamp end at the next scan."""
    pose, found = np.zeros(3), []
    if actions and actions[0][0]:
        found.append(_Motion(scan_stamps[0], pose))
    for number, action in actions:
        pose = se2.compose(pose, action.pose)
        stamp_ns = action.stamp_ns or (scan_stamps[number] if number < len(scan_stamps) else 0)
        if stamp_ns:
            found.append(_Motion(stamp_ns, pose))
    return found


def _scan_stream(data: bytes, label: str, found: list[tuple[int, int]]) -> DatasetStream:
    def event(k: int) -> LaserScan:
        at = found[k][1]
        return _scan(_Fields(data, at), data[at - 1]).scan

    return DatasetStream("scan", label, label, [stamp_ns for stamp_ns, _ in found], event)


def _odometry_stream(odometry: list[_Motion]) -> DatasetStream:
    def event(k: int) -> Odometry:
        x, y, yaw = odometry[k].pose.tolist()
        return Odometry(
            odometry[k].stamp_ns,
            "odom",
            x,
            y,
            canonical_yaw(float(np.remainder(yaw + np.pi, 2 * np.pi) - np.pi)),
        )

    return DatasetStream("odom", "odometry", "odom", [one.stamp_ns for one in odometry], event)


def _of_matrix(matrix: Floats) -> tuple[float, ...]:
    """Position and quaternion of a homogeneous matrix `(4, 4)`."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()
    return (*matrix[:3, 3].tolist(), w, x, y, z)


def _is_same(a: tuple[Vector, Quaternion], b: tuple[Vector, Quaternion]) -> bool:
    q, r = normalise(a[1]), normalise(b[1])
    if q is None or r is None:
        return False
    turned = 1.0 - abs(sum(s * t for s, t in zip(q, r, strict=True)))
    return (
        turned < MAX_SAME_PLACE and max(abs(s - t) for s, t in zip(a[0], b[0], strict=True)) < MAX_SAME_PLACE
    )


def _notes(others: Counter[str], moving: set[str]) -> list[str]:
    """Lines about what is left out, and sensors that move on the robot."""
    left_out = {name: n for name, n in others.items() if not name.startswith("CActionCollection")}
    notes = [
        f"{label} moves on the robot; it is taken to stay where its first scan was"
        for label in sorted(moving)
    ]
    if left_out:
        notes.append(f"not read: {', '.join(f'{n} {name}' for name, n in sorted(left_out.items()))}")
    return notes
