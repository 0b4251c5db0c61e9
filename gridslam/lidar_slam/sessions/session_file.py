"""session.npz: a session as plain arrays, with a version, and read with every bound checked."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.numpy_files import npz_bytes, read_npz
from gridslam.core.plain_files import read_plain_file
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import packed, unpacked
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.object_records import SCHEMA as OBJECT_SCHEMA
from gridslam.lidar_slam.sessions.object_records import records_in
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session, offsets

Arrays = dict[str, NDArray[Any]]

FILE_NAME = "session.npz"
FORMAT, VERSION = "gridslam session", 2
POINT_UNIT_M = 2.0**-10  # coordinates of points are whole numbers of it
NORMAL_UNIT_RAD = 1e-4
MAX_ANGLE = int(np.pi / NORMAL_UNIT_RAD)
NO_NORMAL = np.int16(-32768)
MAX_POINT_M = 1000.0
MAX_FILE_BYTES = 1 << 30
MAX_POSE_M = 1e6
EDGES = ("loops", "visits", "landmarks")
SCHEMA = {  # of all arrays but those of edges: type, columns
    "drive.scans": ("<i8", 0),
    "drive.keys": ("<i8", 0),
    "drive.part": ("<i8", 0),
    "scan.stamp_ns": ("<i8", 0),
    "scan.track": ("<f8", 3),
    "key.scan": ("<i8", 0),
    "key.pose": ("<f8", 3),
    "key.viewpoint": ("<f8", 2),
    "key.returns": ("<i8", 0),
    "key.surface": ("<i8", 0),
    "returns": ("<i4", 2),
    "surface": ("<i4", 2),
    "surface.normal": ("<i2", 0),
}
EDGE_SCHEMA = {"source": ("<i8", 0), "target": ("<i8", 0), "motion": ("<f8", 3), "information": ("<f8", 6)}


def session_bytes(session: Session) -> bytes:
    """The content of session.npz; the same session gives the same bytes."""
    return npz_bytes(_arrays(session))


def _arrays(session: Session) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """All arrays by name, made one after the other: those of points are large."""
    drives, scans, constraints = session.drives, session.scans, session.constraints
    objects = session.objects
    head = {
        "format": FORMAT,
        "version": VERSION,
        "logs": [drive.log for drive in drives],
        "objects": list(objects.ids),
    }
    yield "head", np.frombuffer(json.dumps(head).encode(), np.uint8)
    yield "drive.scans", np.array([len(drive.stamps_ns) for drive in drives], np.int64)
    yield "drive.keys", np.array([len(drive.keys) for drive in drives], np.int64)
    yield "drive.part", session.parts
    yield "scan.stamp_ns", np.concatenate([drive.stamps_ns for drive in drives])
    yield "scan.track", np.concatenate([drive.track for drive in drives])
    yield "key.scan", np.concatenate([drive.keys for drive in drives])
    yield "key.pose", session.poses
    sizes = [(scan.viewpoint, len(scan.returns), len(scan.surface)) for scan in scans]
    yield "key.viewpoint", np.array([viewpoint for viewpoint, _, _ in sizes])
    returns = np.array([count for _, count, _ in sizes], np.int64)
    surfaces = np.array([count for _, _, count in sizes], np.int64)
    yield "key.returns", returns
    yield "key.surface", surfaces
    yield "returns", _packed_points((scan.returns for scan in scans), int(returns.sum()))
    yield "surface", _packed_points((scan.surface for scan in scans), int(surfaces.sum()))
    yield "surface.normal", np.concatenate([_packed_normals(scan.surface_normals) for scan in scans])
    for name in EDGES:
        yield from _edge_arrays(name, getattr(constraints, name)).items()
    yield from objects.arrays().items()


def load_session(path: Path) -> Session:
    """The session that a run left. Raises InputError: the file cannot be read, is damaged or of another version."""
    try:
        return read_session(read_plain_file(path, MAX_FILE_BYTES), str(path))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def read_session(content: bytes, name: str) -> Session:
    """The session of a file's content. Raises InputError, which names the file: damaged, or of another version."""
    try:
        arrays = read_npz(content)
        logs, objects = _names(arrays.pop("head", None))
        _check(arrays)
        return _session(arrays, logs, objects)
    except ValueError as error:
        raise InputError(
            f"{name}: not a session that can be continued: {error}; map its logs again"
        ) from None


def _names(head: NDArray[np.generic] | None) -> tuple[list[str], list[str]]:
    """Names of the logs, and of the objects of all estimates. Raises ValueError: it is not of this format and version."""
    try:
        if head is None or head.dtype != np.uint8:
            raise ValueError
        document = json.loads(head.tobytes())
        kind, version, logs = document["format"], document["version"], document["logs"]
        objects = document.get("objects")
    except (ValueError, TypeError, KeyError, RecursionError):
        raise ValueError("it has no readable head") from None
    if kind != FORMAT:
        raise ValueError("it is another kind of file")
    if version != VERSION:
        raise ValueError(f"version {str(version)[:20]}, this program reads version {VERSION}")
    for names in (logs, objects):
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ValueError("its logs or objects have no names")
    return logs, objects


def _check(arrays: Arrays) -> None:
    """Types, sizes and ranges of all arrays. Raises ValueError: one is missing or wrong."""
    schema = {**SCHEMA, **OBJECT_SCHEMA}
    schema.update({f"{name}.{column}": form for name in EDGES for column, form in EDGE_SCHEMA.items()})
    for name, (kind, columns) in schema.items():
        values = arrays.get(name)
        if (
            values is None
            or values.dtype != np.dtype(kind)
            or values.shape[1:] != ((columns,) if columns else ())
        ):
            raise ValueError(f"{name} is missing or of another form")
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise ValueError(f"{name} is not finite")
    rows = {name: len(arrays[name]) for name in schema}
    sums = {
        name: _total(arrays[name]) for name in ("drive.scans", "drive.keys", "key.returns", "key.surface")
    }
    keys = rows["key.pose"]
    expected = [
        (rows["drive.keys"], rows["drive.scans"]),
        (rows["drive.part"], rows["drive.scans"]),
        (sums["drive.scans"], rows["scan.stamp_ns"]),
        (rows["scan.track"], rows["scan.stamp_ns"]),
        (sums["drive.keys"], keys),
        *((rows[name], keys) for name in ("key.scan", "key.viewpoint", "key.returns", "key.surface")),
        (sums["key.returns"], rows["returns"]),
        (sums["key.surface"], rows["surface"]),
        (rows["surface.normal"], rows["surface"]),
        *((rows[f"{name}.{column}"], rows[f"{name}.source"]) for name in EDGES for column in EDGE_SCHEMA),
    ]
    if any(one != other for one, other in expected):
        raise ValueError("its arrays do not fit each other")
    if np.abs(arrays["key.pose"]).max(initial=0.0) > MAX_POSE_M:
        raise ValueError("a pose is out of range")
    if np.abs(arrays["scan.track"]).max(initial=0.0) > MAX_POSE_M:
        raise ValueError("a pose is out of range")


def _total(counts: NDArray[np.generic]) -> int:
    """The sum of counts. Raises ValueError: one is negative or too large."""
    if len(counts) and not (counts.min() >= 0 and counts.max() < 2**31):
        raise ValueError("a count is out of range")
    return int(counts.sum())


def _session(arrays: Arrays, logs: list[str], objects: list[str]) -> Session:
    a = arrays
    first_scan, first_key = offsets(a["drive.scans"].tolist()), offsets(a["drive.keys"].tolist())
    if len(logs) != len(a["drive.keys"]) or not len(logs) or (a["drive.keys"] < 1).any():
        raise ValueError("a drive has no key scans")
    scans = _scans(a, first_key, first_scan)
    drives = tuple(
        Drive(
            log,
            a["scan.stamp_ns"][first_scan[d] : first_scan[d + 1]],
            a["scan.track"][first_scan[d] : first_scan[d + 1]],
            keys=a["key.scan"][first_key[d] : first_key[d + 1]],
            scans=scans[first_key[d] : first_key[d + 1]],
        )
        for d, log in enumerate(logs)
    )
    n_keys = int(first_key[-1])
    constraints = Constraints(*(_edges(a, name, n_keys) for name in EDGES))
    return Session(
        drives, a["key.pose"], a["drive.part"], constraints, objects=records_in(a, objects, n_keys)
    )


def _scans(a: Arrays, first_key: NDArray[np.int64], first_scan: NDArray[np.int64]) -> list[PreparedScan]:
    """The key scans. Their surfaces stand for the points that are matched: a key scan is matched as part of a map only."""
    for d in range(len(first_key) - 1):
        own = a["key.scan"][first_key[d] : first_key[d + 1]]
        if own[0] != 0 or (np.diff(own) <= 0).any() or own[-1] >= first_scan[d + 1] - first_scan[d]:
            raise ValueError("a key scan is none of its drive's scans")
    rows = np.repeat(first_scan[:-1], np.diff(first_key)) + a["key.scan"]
    stamps = a["scan.stamp_ns"][rows].tolist()
    returns, surface = _points(a["returns"]), _points(a["surface"])
    normals = _normals(a["surface.normal"])
    r, s = offsets(a["key.returns"].tolist()), offsets(a["key.surface"].tolist())
    return [
        PreparedScan(
            stamp,
            a["key.viewpoint"][k],
            returns[r[k] : r[k + 1]],
            points=surface[s[k] : s[k + 1]],
            normals=normals[s[k] : s[k + 1]],
            surface=surface[s[k] : s[k + 1]],
            surface_normals=normals[s[k] : s[k + 1]],
        )
        for k, stamp in enumerate(stamps)
    ]


def _packed_points(parts: Iterable[NDArray[np.float64]], count: int) -> NDArray[np.int32]:
    """`count` points of all parts as differences of whole numbers, which compress well."""
    packed_points = np.empty((count, 2), np.int32)
    last, at = np.zeros((1, 2), np.int32), 0
    for part in parts:
        whole = np.concatenate([last, np.rint(part / POINT_UNIT_M).astype(np.int32)])
        packed_points[at : at + len(part)] = np.diff(whole, axis=0)
        last, at = whole[-1:], at + len(part)
    return packed_points


def _points(packed_points: NDArray[np.int64]) -> NDArray[np.float64]:
    whole = np.cumsum(packed_points, axis=0, dtype=np.int64)
    if np.abs(whole).max(initial=0) > MAX_POINT_M / POINT_UNIT_M:
        raise ValueError("a point is out of range")
    return np.asarray(whole * POINT_UNIT_M, np.float64)


def _packed_normals(normals: NDArray[np.float64]) -> NDArray[np.int16]:
    angle = np.rint(np.arctan2(normals[:, 1], normals[:, 0]) / NORMAL_UNIT_RAD)
    angle = np.clip(angle, -MAX_ANGLE, MAX_ANGLE)  # a little beyond pi would be read as another angle
    return np.where(normals.any(axis=1), angle, NO_NORMAL).astype(np.int16)


def _normals(angles: NDArray[np.int64]) -> NDArray[np.float64]:
    angle = angles * NORMAL_UNIT_RAD
    is_known = (angles != NO_NORMAL)[:, None]
    return np.asarray(np.where(is_known, np.stack([np.cos(angle), np.sin(angle)], axis=1), 0.0), np.float64)


def _edge_arrays(name: str, edges: Edges) -> dict[str, NDArray[np.generic]]:
    return {
        f"{name}.source": edges.source,
        f"{name}.target": edges.target,
        f"{name}.motion": edges.T_source_target,
        f"{name}.information": packed(edges.information),
    }


def _edges(a: Arrays, name: str, n_keys: int) -> Edges:
    """Edges between key scans. Raises ValueError: one is out of range."""
    source, target = a[f"{name}.source"], a[f"{name}.target"]
    nodes = np.concatenate([source, target])
    if len(nodes) and not (nodes.min() >= 0 and nodes.max() < n_keys):
        raise ValueError(f"{name}: an edge without a key scan")
    information = unpacked(a[f"{name}.information"])
    if len(information) and np.linalg.eigvalsh(information)[:, 0].min() < -1e-6 * np.abs(information).max():
        raise ValueError(f"{name}: an information matrix is not positive")
    motion = a[f"{name}.motion"]
    if np.abs(motion).max(initial=0.0) > MAX_POSE_M:
        raise ValueError(f"{name}: a motion is out of range")
    return Edges(source, target, motion, information, np.ones(len(source), np.bool_))
