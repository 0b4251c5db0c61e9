"""A rawlog of MRPT: scans of 2-D lidars and the robot's odometry, plain or packed with gzip."""

from __future__ import annotations

import re
import struct
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import LogError
from gridslam.core.messages import LaserScan, Odometry, Transform, canonical_yaw
from gridslam.logs.datasets.rawlog_objects import (
    READERS,
    ObjectFields,
    RecordedMotion,
    RecordedScan,
    objects_in,
    read_scan,
)
from gridslam.logs.datasets.source import BASE_FRAME, DatasetSource, DatasetStream
from gridslam.logs.rotations import Quaternion, Vector, normalise
from gridslam.logs.text import open_ahead, packing_of

Floats = NDArray[np.float64]

MAX_BYTES = 2 << 30  # largest unpacked size; larger files would not fit in the memory of small machines
# Largest expansion of a packed file above a size, against bombs
MAX_EXPANSION, ALWAYS_UNPACKED_BYTES = 100, 4 << 20
MAX_SAME_PLACE = 1e-3  # m and quaternion: a sensor whose pose changes by more moves on the robot


def is_rawlog(beginning: bytes) -> bool:
    """Whether a file whose first unpacked bytes are `beginning` is a rawlog."""
    return (
        re.match(rb"[\x80-\xff](?:mrpt::\w+::)?C(Observation\w+|ActionCollection|SensoryFrame)", beginning)
        is not None
    )


def open_rawlog(path: Path) -> DatasetSource:
    """The scans of each lidar, the odometry, and the lidars' extrinsics. Raises LogError: there is no scan, or too much."""
    data = _unpacked(path)
    scans: dict[str, list[tuple[int, int]]] = {}  # stamp and offset in the file of each scan, by label
    places: dict[str, tuple[Vector, Quaternion]] = {}
    moving: set[str] = set()
    odometry: list[RecordedMotion] = []
    actions: list[tuple[int, RecordedMotion]] = []  # number of scans before, and the motion
    order: list[int] = []  # stamps of all scans
    others: Counter[str] = Counter()
    damaged: list[str] = []
    for name, at, version in objects_in(data):
        reader = READERS.get(name)
        if reader is None:
            others[name] += 1
            continue
        try:
            found = reader(ObjectFields(data, at), version)
        except (ValueError, struct.error) as error:
            damaged.append(f"{name} at byte {at} ({error})")
            continue
        if isinstance(found, RecordedScan):
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


def _summed(actions: list[tuple[int, RecordedMotion]], scan_stamps: list[int]) -> list[RecordedMotion]:
    """Poses by summing the increments of actions; an increment without a stamp ends at the next scan."""
    pose, found = np.zeros(3), []
    if actions and actions[0][0]:
        found.append(RecordedMotion(scan_stamps[0], pose))
    for number, action in actions:
        pose = se2.compose(pose, action.pose)
        stamp_ns = action.stamp_ns or (scan_stamps[number] if number < len(scan_stamps) else 0)
        if stamp_ns:
            found.append(RecordedMotion(stamp_ns, pose))
    return found


def _scan_stream(data: bytes, label: str, found: list[tuple[int, int]]) -> DatasetStream:
    def event(k: int) -> LaserScan:
        at = found[k][1]
        return read_scan(ObjectFields(data, at), data[at - 1]).scan

    return DatasetStream("scan", label, label, [stamp_ns for stamp_ns, _ in found], event)


def _odometry_stream(odometry: list[RecordedMotion]) -> DatasetStream:
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


def _is_same(a: tuple[Vector, Quaternion], b: tuple[Vector, Quaternion]) -> bool:
    q, r = normalise(a[1]), normalise(b[1])
    if q is None or r is None:
        return False
    turned = 1.0 - abs(sum(s * t for s, t in zip(q, r, strict=True)))
    return (
        turned < MAX_SAME_PLACE and max(abs(s - t) for s, t in zip(a[0], b[0], strict=True)) < MAX_SAME_PLACE
    )


def _notes(others: Counter[str], moving: set[str]) -> list[str]:
    """Lines about objects that were not read, and sensors that move on the robot."""
    left_out = {name: n for name, n in others.items() if not name.startswith("CActionCollection")}
    notes = [
        f"{label} moves on the robot; it is taken to stay where its first scan was"
        for label in sorted(moving)
    ]
    if left_out:
        notes.append(f"not read: {', '.join(f'{n} {name}' for name, n in sorted(left_out.items()))}")
    return notes
