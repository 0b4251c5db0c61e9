"""Checks of the arrays of a session.npz: their types and shapes, the range of their values, and whether they fit each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import END_NS
from gridslam.lidar_slam.sessions.stored_scans import CHUNK_SCANS, MAX_POINT_M, RETURN_BYTES, SURFACE_BYTES
from gridslam.lidar_slam.sway import MAX_SWING_M

Arrays = dict[str, NDArray[Any]]
# Name of an array: its type, and its number of columns (0: one dimension)
Schema = dict[str, tuple[str, int]]

MAX_POINT_BYTES = 1 << 29  # largest size of the unpacked points: some 100,000 key scans
MAX_SCAN_POINTS = 100_000
MAX_KEY_SCANS = 300_000  # each takes 1 KB besides its points
MAX_POSE_M = 1e6
MAX_INFORMATION = 1e15  # largest information of an edge: m, rad to a thirtieth of a micron
MAX_EVIDENCE = 1e9  # log odds, and covariances (m^2, rad^2)
_POSES, _STAMPS, _EVIDENCE = (-MAX_POSE_M, MAX_POSE_M), (0, END_NS - 1), (-MAX_EVIDENCE, MAX_EVIDENCE)
RANGES: dict[str, tuple[float, float]] = {  # lowest and highest value of an array
    "key.pose": _POSES,
    "scan.track": _POSES,
    "scan.stamp_ns": _STAMPS,
    "scan.swing": (-MAX_SWING_M, MAX_SWING_M),
    "key.viewpoint": (-MAX_POINT_M, MAX_POINT_M),
    "drive.range_m": (0.0, MAX_POSE_M),
    "drive.part": (0, MAX_KEY_SCANS),
    "object.pose": _POSES,
    "object.covariance": _EVIDENCE,
    "object.stamps_ns": _STAMPS,
    "object.reads": (0, 2**31),
    "object.gain": _EVIDENCE,
    "object.closed_yaw": _POSES,
    "object.gone_ns": _STAMPS,
    "drawn.log_odds": _EVIDENCE,
    "drawn.pose": _POSES,
    "change.stamps_ns": _STAMPS,
}
# Only if a robot sways: the shift of the lidar at every scan
SWAY_SCHEMA: Schema = {"scan.swing": ("<f8", 2)}
SCHEMA: Schema = {
    "drive.scans": ("<i8", 0),  # number of scans of each drive
    "drive.keys": ("<i8", 0),  # number of its key scans
    "drive.part": ("<i8", 0),
    "drive.range_m": ("<f8", 0),
    "scan.stamp_ns": ("<i8", 0),  # of all scans of all drives
    "scan.track": ("<f8", 3),
    "key.scan": ("<i8", 0),  # row of each key scan among the scans of its drive
    "key.pose": ("<f8", 3),
    "key.viewpoint": ("<f8", 2),
    "key.returns": ("<i8", 0),  # number of returns
    "key.surface": ("<i8", 0),  # number of surface points
    "chunk.bytes": ("<i8", 0),  # size of each packed chunk of key scans
    "points": ("|u1", 0),  # the chunks, one after the other
}
EDGES = ("loops", "visits", "landmarks")
EDGE_SCHEMA: Schema = {  # of each kind of edges, whose name comes first: loops.source
    "source": ("<i8", 0),
    "target": ("<i8", 0),
    "motion": ("<f8", 3),
    "information": ("<f8", 6),
}


def check_arrays(arrays: Arrays, schema: Schema) -> None:
    """Raises ValueError: an array of the schema, or of edges, is missing, or has another type, size or range.

    `schema` has at least the arrays of SCHEMA.
    """
    edge_schema = {f"{name}.{column}": form for name in EDGES for column, form in EDGE_SCHEMA.items()}
    schema = {**schema, **edge_schema}
    for name, (kind, columns) in schema.items():
        values = arrays.get(name)
        if (
            values is None
            or values.dtype != np.dtype(kind)
            or values.ndim != (2 if columns else 1)
            or (columns and values.shape[1] != columns)
        ):
            raise ValueError(f"{name} is missing or of another form")
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise ValueError(f"{name} is not finite")
    _check_sizes(arrays, {name: len(arrays[name]) for name in schema})
    for name, (low, high) in RANGES.items():
        if (
            name in schema
            and len(values := arrays[name])
            and not (values.min() >= low and values.max() <= high)
        ):
            raise ValueError(f"{name} is out of range")


def _check_sizes(arrays: Arrays, rows: dict[str, int]) -> None:
    """Raises ValueError: the arrays do not fit each other, or are too large."""
    counts = ("drive.scans", "drive.keys", "key.returns", "key.surface", "chunk.bytes")
    sums = {name: _total(arrays[name]) for name in counts}
    keys = rows["key.pose"]
    expected = [
        (rows["drive.keys"], rows["drive.scans"]),
        (rows["drive.part"], rows["drive.scans"]),
        (rows["drive.range_m"], rows["drive.scans"]),
        (sums["drive.scans"], rows["scan.stamp_ns"]),
        (rows["scan.track"], rows["scan.stamp_ns"]),
        (rows.get("scan.swing", rows["scan.track"]), rows["scan.track"]),
        (sums["drive.keys"], keys),
        *((rows[name], keys) for name in ("key.scan", "key.viewpoint", "key.returns", "key.surface")),
        (int((-(-arrays["drive.keys"] // CHUNK_SCANS)).sum()), rows["chunk.bytes"]),
        (sums["chunk.bytes"], rows["points"]),
        *((rows[f"{name}.{column}"], rows[f"{name}.source"]) for name in EDGES for column in EDGE_SCHEMA),
    ]
    if any(one != other for one, other in expected):
        raise ValueError("its arrays do not fit each other")
    unpacked_bytes = RETURN_BYTES * sums["key.returns"] + SURFACE_BYTES * sums["key.surface"]
    if unpacked_bytes > MAX_POINT_BYTES:
        raise ValueError(
            f"it claims to hold {unpacked_bytes} bytes of points; the limit is {MAX_POINT_BYTES}"
        )
    if max(arrays[name].max(initial=0) for name in ("key.returns", "key.surface")) > MAX_SCAN_POINTS:
        raise ValueError(f"a key scan claims to hold more than {MAX_SCAN_POINTS} points")
    if keys > MAX_KEY_SCANS:
        raise ValueError(f"it has {keys} key scans; the limit is {MAX_KEY_SCANS}")


def _total(counts: NDArray[np.generic]) -> int:
    """The sum of counts. Raises ValueError: one is negative or too large."""
    if len(counts) and not (counts.min() >= 0 and counts.max() < 2**31):
        raise ValueError("a count is out of range")
    return int(counts.sum())
