"""A session as plain arrays, and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import offsets_of
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import packed, unpacked
from gridslam.lidar_slam.sessions.drawn_file import drawn_arrays, drawn_in
from gridslam.lidar_slam.sessions.object_records import records_in
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session
from gridslam.lidar_slam.sessions.session_checks import EDGES, MAX_INFORMATION, MAX_POSE_M, Arrays
from gridslam.lidar_slam.sessions.stored_scans import CHUNK_SCANS, StoredScans


def arrays_of(session: Session) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Pairs (name, array) as in `session_checks.SCHEMA`, one after the other, because those of points are large."""
    drives = session.drives
    scans = [StoredScans.of(drive.scans) for drive in drives]
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
    if session.drawn is not None:
        yield from drawn_arrays(session.drawn)
    for name in EDGES:
        yield from _edge_arrays(name, getattr(session.constraints, name)).items()
    yield from session.objects.arrays().items()


def session_of(a: Arrays, logs: Sequence[str], object_ids: Sequence[str], drawn_frame: Any) -> Session:
    """The session of checked arrays `a`, with the names of its logs and the ids of the objects of all estimates.

    `drawn_frame` is the document of the drawn map's frame, None without one. Raises ValueError: the arrays contradict each other.
    """
    if not len(logs) or (a["drive.keys"] < 1).any():
        raise ValueError("a drive has no key scans")
    first_key = offsets_of(a["drive.keys"].tolist())
    n_keys = int(first_key[-1])
    return Session(
        tuple(_drives(a, logs)),
        a["key.pose"],
        a["drive.part"],
        Constraints(*(_edges(a, name, n_keys) for name in EDGES)),
        objects=records_in(a, object_ids, n_keys),
        drawn=drawn_in(a, drawn_frame, first_key) if drawn_frame else None,
    )


def _drives(a: Arrays, logs: Sequence[str]) -> Iterator[Drive]:
    """The drives, which each own a range of the rows of every array. Raises ValueError: a key scan is not one of its drive."""
    first_scan, first_key = offsets_of(a["drive.scans"].tolist()), offsets_of(a["drive.keys"].tolist())
    first_chunk = offsets_of((-(-a["drive.keys"] // CHUNK_SCANS)).tolist())
    ends = offsets_of(a["chunk.bytes"].tolist())
    content = memoryview(a["points"].tobytes())
    chunks = [content[start:end] for start, end in pairwise(ends.tolist())]
    no_swing = np.zeros((0, 2))
    for d, log in enumerate(logs):
        scans = slice(first_scan[d], first_scan[d + 1])
        keys = slice(first_key[d], first_key[d + 1])
        stamps_ns, key_rows = a["scan.stamp_ns"][scans], a["key.scan"][keys]
        if key_rows[0] != 0 or (np.diff(key_rows) <= 0).any() or key_rows[-1] >= len(stamps_ns):
            raise ValueError("a key scan is none of its drive's scans")
        swing_m = a.get("scan.swing", no_swing)[scans]
        yield Drive(
            log,
            stamps_ns,
            a["scan.track"][scans],
            keys=key_rows,
            scans=StoredScans(
                stamps_ns[key_rows],
                a["key.viewpoint"][keys],
                (a["key.returns"][keys], a["key.surface"][keys]),
                chunks[first_chunk[d] : first_chunk[d + 1]],
            ),
            range_m=float(a["drive.range_m"][d]),
            swing_m=swing_m if swing_m.any() else None,
        )


def _edge_arrays(name: str, edges: Edges) -> dict[str, NDArray[np.generic]]:
    """The arrays of the edges of one kind, `name`."""
    return {
        f"{name}.source": edges.source,
        f"{name}.target": edges.target,
        f"{name}.motion": edges.T_source_target,
        f"{name}.information": packed(edges.information),
    }


def _edges(a: Arrays, name: str, n_keys: int) -> Edges:
    """The edges of one kind, `name`, between key scans. Raises ValueError: a value of one is out of range."""
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
