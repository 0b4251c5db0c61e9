"""session.npz: a session as plain arrays, with a version, and read with every bound checked."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import offsets_of
from gridslam.core.errors import InputError
from gridslam.core.numpy_files import npz_bytes, read_npz
from gridslam.core.plain_files import read_plain_file
from gridslam.core.stamps import END_NS
from gridslam.core.texts import is_storable
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import packed, unpacked
from gridslam.lidar_slam.sessions.drawn_file import MAX_CELLS as MAX_DRAWN_CELLS
from gridslam.lidar_slam.sessions.drawn_file import SCHEMA as DRAWN_SCHEMA
from gridslam.lidar_slam.sessions.drawn_file import drawn_arrays, drawn_in, frame_document
from gridslam.lidar_slam.sessions.object_records import SCHEMA as OBJECT_SCHEMA
from gridslam.lidar_slam.sessions.object_records import records_in
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session
from gridslam.lidar_slam.sessions.stored_scans import (
    CHUNK_SCANS,
    MAX_POINT_M,
    RETURN_BYTES,
    SURFACE_BYTES,
    StoredScans,
)
from gridslam.lidar_slam.sway import MAX_SWING_M

Arrays = dict[str, NDArray[Any]]

FILE_NAME = "session.npz"
DIGEST = "digest"  # name of the array with the SHA-256 of all others
FORMAT, VERSION = "gridslam session", 4
MAX_FILE_BYTES = MAX_UNPACKED_BYTES = 1 << 28  # without the points, which are unpacked when they are needed
MAX_POINT_BYTES = 1 << 29  # largest size of the unpacked points: some 100,000 key scans
MAX_SCAN_POINTS = 100_000
MAX_HEAD_BYTES = 1 << 22
MIN_KEY_BYTES = 50  # smallest size of a key scan in the file, of which the poses alone take more
MAX_KEY_SCANS = 300_000  # each takes 1 KB besides its points
MAX_POSE_M = 1e6
MAX_INFORMATION = 1e15  # largest information of an edge: m, rad to a thirtieth of a micron
MAX_EVIDENCE = 1e9  # log odds, and covariances (m^2, rad^2)
_POSES, _STAMPS, _EVIDENCE = (-MAX_POSE_M, MAX_POSE_M), (0, END_NS - 1), (-MAX_EVIDENCE, MAX_EVIDENCE)
RANGES: dict[str, tuple[float, float]] = {  # lowest and highest value
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
SWAY_SCHEMA = {"scan.swing": ("<f8", 2)}  # only where a robot sways
EDGES = ("loops", "visits", "landmarks")
SCHEMA = {  # of all arrays but those of edges: type, columns
    "drive.scans": ("<i8", 0),
    "drive.keys": ("<i8", 0),
    "drive.part": ("<i8", 0),
    "drive.range_m": ("<f8", 0),
    "scan.stamp_ns": ("<i8", 0),
    "scan.track": ("<f8", 3),
    "key.scan": ("<i8", 0),
    "key.pose": ("<f8", 3),
    "key.viewpoint": ("<f8", 2),
    "key.returns": ("<i8", 0),
    "key.surface": ("<i8", 0),
    "chunk.bytes": ("<i8", 0),
    "points": ("|u1", 0),
}
EDGE_SCHEMA = {"source": ("<i8", 0), "target": ("<i8", 0), "motion": ("<f8", 3), "information": ("<f8", 6)}


def session_bytes(session: Session) -> bytes:
    """The content of session.npz; the same session gives the same bytes."""
    return npz_bytes(with_digest(_arrays(session)), stored=("points",))


def with_digest(arrays: Iterable[tuple[str, NDArray[Any]]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """The pairs (name, array), and finally `digest`, by which a later change of their contents is noticed."""
    digests = {}
    for name, values in arrays:
        digests[name] = _digest_of(values)
        yield name, values
    yield DIGEST, np.frombuffer(bytes.fromhex(_digest_of_all(digests)), np.uint8)


def _digest_of(values: NDArray[Any]) -> str:
    """The digest of an array: its type, shape and content."""
    digest = hashlib.sha256(f"{values.dtype.str} {values.shape}".encode())
    is_plain = values.dtype.kind in "biuf"  # which damaged files need not have
    digest.update(
        np.ascontiguousarray(values).reshape(-1).view(np.uint8).data if is_plain else values.tobytes()
    )
    return digest.hexdigest()


def _digest_of_all(digests: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(digests, sort_keys=True).encode()).hexdigest()


def _arrays(session: Session) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """All arrays by name, made one after the other: those of points are large."""
    drives, objects, drawn = session.drives, session.objects, session.drawn
    if drawn is not None and drawn.log_odds.size > MAX_DRAWN_CELLS:
        drawn = None
    scans = [StoredScans.of(drive.scans) for drive in drives]
    head = {
        "format": FORMAT,
        "version": VERSION,
        "logs": [drive.log for drive in drives],
        "objects": list(objects.ids),
        "drawn": None if drawn is None else frame_document(drawn.frame),
    }
    yield "head", np.frombuffer(json.dumps(head).encode(), np.uint8)
    yield "drive.scans", np.array([len(drive.stamps_ns) for drive in drives], np.int64)
    yield "drive.keys", np.array([len(drive.keys) for drive in drives], np.int64)
    yield "drive.part", session.parts
    yield "drive.range_m", np.array([drive.range_m for drive in drives])
    yield "scan.stamp_ns", np.concatenate([drive.stamps_ns for drive in drives])
    yield "scan.track", np.concatenate([drive.track for drive in drives])
    if any(drive.swing_m is not None for drive in drives):
        swings = [np.zeros((len(d.stamps_ns), 2)) if d.swing_m is None else d.swing_m for d in drives]
        yield "scan.swing", np.concatenate(swings)
    yield "key.scan", np.concatenate([drive.keys for drive in drives])
    yield "key.pose", session.poses
    yield "key.viewpoint", np.concatenate([stored.viewpoints for stored in scans])
    yield "key.returns", np.concatenate([stored.counts[0] for stored in scans])
    yield "key.surface", np.concatenate([stored.counts[1] for stored in scans])
    chunks = [chunk for stored in scans for chunk in stored.chunks]
    yield "chunk.bytes", np.array([len(chunk) for chunk in chunks], np.int64)
    yield "points", np.frombuffer(b"".join(chunks), np.uint8)
    if drawn is not None:
        yield from drawn_arrays(drawn)
    for name in EDGES:
        yield from _edge_arrays(name, getattr(session.constraints, name)).items()
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
        arrays = read_npz(io.BytesIO(content), MAX_UNPACKED_BYTES)
        head = _head(arrays.get("head"))
        _check_digest(arrays)
        optional = {
            **(DRAWN_SCHEMA if head["drawn"] else {}),
            **(SWAY_SCHEMA if "scan.swing" in arrays else {}),
        }
        _check(arrays, {**SCHEMA, **OBJECT_SCHEMA, **optional})
        if MIN_KEY_BYTES * len(arrays["key.pose"]) > len(content):
            raise ValueError(f"it claims to hold {len(arrays['key.pose'])} key scans in {len(content)} bytes")
        if len(head["logs"]) != len(arrays["drive.keys"]):
            raise ValueError("a drive has no log")
        return _session(arrays, head)
    except ValueError as error:
        raise InputError(
            f"{name}: not a session that can be continued: {error}; map its logs again"
        ) from None


def _check_digest(arrays: Arrays) -> None:
    """Raises ValueError: the arrays are not those that were written."""
    stored = arrays.pop(DIGEST, np.zeros(0, np.uint8))
    if stored.tobytes().hex() != _digest_of_all(
        {name: _digest_of(values) for name, values in arrays.items()}
    ):
        raise ValueError("its content was changed after it was written")


def _head(head: NDArray[np.generic] | None) -> dict[str, Any]:
    """Names of the `logs`, and of the `objects` of all estimates, and the frame of the map that is `drawn`, or None.

    Raises ValueError: it is not of this format and version.
    """
    try:
        if head is None or head.dtype != np.uint8 or head.size > MAX_HEAD_BYTES:
            raise ValueError
        document = json.loads(head.tobytes())
        kind, version, logs = document["format"], document["version"], document["logs"]
        objects, drawn = document.get("objects"), document.get("drawn")
    except (ValueError, TypeError, KeyError, RecursionError):
        raise ValueError("it has no readable head") from None
    if kind != FORMAT:
        raise ValueError("it is another kind of file")
    if version != VERSION:
        raise ValueError(f"version {repr(version)[:20]}, this program reads version {VERSION}")
    for names in (logs, objects):
        if not isinstance(names, list) or not all(
            isinstance(name, str) and is_storable(name) for name in names
        ):
            raise ValueError("its logs or objects have no names that can be written")
    return {"logs": logs, "objects": objects, "drawn": drawn}


def _check(arrays: Arrays, schema: dict[str, tuple[str, int]]) -> None:
    """Raises ValueError: an array is missing, or of another type, size or range than those of a session."""
    schema = dict(schema)
    schema.update({f"{name}.{column}": form for name in EDGES for column, form in EDGE_SCHEMA.items()})
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


def _session(arrays: Arrays, head: dict[str, Any]) -> Session:
    a, logs = arrays, head["logs"]
    first_scan, first_key = offsets_of(a["drive.scans"].tolist()), offsets_of(a["drive.keys"].tolist())
    if not len(logs) or (a["drive.keys"] < 1).any():
        raise ValueError("a drive has no key scans")
    first_chunk = offsets_of((-(-a["drive.keys"] // CHUNK_SCANS)).tolist())
    ends = offsets_of(a["chunk.bytes"].tolist())
    content = memoryview(a["points"].tobytes())
    chunks = [content[start:end] for start, end in pairwise(ends.tolist())]
    drives, no_swing = [], np.zeros((0, 2))
    for d, log in enumerate(logs):
        keys = slice(first_key[d], first_key[d + 1])
        own, stamps = a["key.scan"][keys], a["scan.stamp_ns"][first_scan[d] : first_scan[d + 1]]
        if own[0] != 0 or (np.diff(own) <= 0).any() or own[-1] >= len(stamps):
            raise ValueError("a key scan is none of its drive's scans")
        scans = StoredScans(
            stamps[own],
            a["key.viewpoint"][keys],
            (a["key.returns"][keys], a["key.surface"][keys]),
            chunks[first_chunk[d] : first_chunk[d + 1]],
        )
        rows = slice(first_scan[d], first_scan[d + 1])
        swing = a.get("scan.swing", no_swing)[rows]
        drives.append(
            Drive(
                log,
                stamps,
                a["scan.track"][rows],
                keys=own,
                scans=scans,
                range_m=float(a["drive.range_m"][d]),
                swing_m=swing if swing.any() else None,
            )
        )
    n_keys = int(first_key[-1])
    return Session(
        tuple(drives),
        a["key.pose"],
        a["drive.part"],
        Constraints(*(_edges(a, name, n_keys) for name in EDGES)),
        objects=records_in(a, head["objects"], n_keys),
        drawn=drawn_in(a, head["drawn"], first_key) if head["drawn"] else None,
    )


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
    if np.abs(information).max(initial=0.0) > MAX_INFORMATION:
        raise ValueError(f"{name}: an information is out of range")
    if len(information) and np.linalg.eigvalsh(information)[:, 0].min() < -1e-6 * np.abs(information).max():
        raise ValueError(f"{name}: an information matrix is not positive")
    motion = a[f"{name}.motion"]
    if np.abs(motion).max(initial=0.0) > MAX_POSE_M:
        raise ValueError(f"{name}: a motion is out of range")
    return Edges(source, target, motion, information, np.ones(len(source), np.bool_))
