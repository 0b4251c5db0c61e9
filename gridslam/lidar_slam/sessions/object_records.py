"""Records of tagged objects in a session: all estimates of their poses, each relative to a key scan of its drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.graph.relative_covariance import packed, unpacked

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SCHEMA = {
    "object.anchor": ("<i8", 0),
    "object.pose": ("<f8", 3),
    "object.covariance": ("<f8", 6),
    "object.stamps_ns": ("<i8", 2),
    "object.reads": ("<i8", 0),
    "object.gain": ("<f8", 0),
    "object.closed_yaw": ("<f8", 0),
    "object.has_closed_yaw": ("<i8", 0),
    "object.gone_ns": ("<i8", 0),
    "object.is_gone": ("<i8", 0),
}


@dataclass(frozen=True, slots=True)
class ObjectRecords:
    """Estimates of tagged objects, in the order of the drives: the object's id `(n,)`, and the key scan `anchor` `(n,)`.

    `poses` `(n, 3)` and `covariances` `(n, 3, 3)` are relative to the key scan, as is `closed_yaw` `(n,)` (NaN: no door whose
    wall is known). `stamps_ns` `(n, 2)` are those of the first and last of the `reads` `(n,)`. `gone_ns` `(n,)` is the stamp at
    which it was found to be gone, where `is_gone`. `gain` `(n,)` is the log likelihood ratio of the scans with and without it.
    """

    ids: tuple[str, ...]
    anchor: Ints
    poses: Floats
    covariances: Floats
    stamps_ns: Ints
    reads: Ints
    gain: Floats
    closed_yaw: Floats
    gone_ns: Ints
    is_gone: Bools

    @staticmethod
    def none() -> ObjectRecords:
        """No estimates."""
        whole, real = np.zeros(0, np.int64), np.zeros(0)
        return ObjectRecords(
            (),
            anchor=whole,
            poses=np.zeros((0, 3)),
            covariances=np.zeros((0, 3, 3)),
            stamps_ns=np.zeros((0, 2), np.int64),
            reads=whole,
            gain=real,
            closed_yaw=real,
            gone_ns=whole,
            is_gone=np.zeros(0, np.bool_),
        )

    @staticmethod
    def concatenate(parts: Sequence[ObjectRecords]) -> ObjectRecords:
        """The estimates of all parts, in order."""
        columns = [f.name for f in fields(ObjectRecords)][1:]
        ids = tuple(name for part in parts for name in part.ids)
        return ObjectRecords(ids, *(np.concatenate([getattr(part, c) for part in parts]) for c in columns))

    def select(self, kept: Sequence[bool]) -> ObjectRecords:
        """Some of the estimates."""
        rows = np.flatnonzero(np.array(kept, np.bool_))
        columns = [f.name for f in fields(ObjectRecords)][1:]
        return ObjectRecords(tuple(self.ids[r] for r in rows), *(getattr(self, c)[rows] for c in columns))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays of a session's file by name, each with `n` rows as in `SCHEMA`; the ids are in the file's head."""
        is_known = np.isfinite(self.closed_yaw)
        return {
            "object.anchor": self.anchor,
            "object.pose": self.poses,
            "object.covariance": packed(self.covariances),
            "object.stamps_ns": self.stamps_ns,
            "object.reads": self.reads,
            "object.gain": self.gain,
            "object.closed_yaw": np.where(is_known, self.closed_yaw, 0.0),
            "object.has_closed_yaw": is_known.astype(np.int64),
            "object.gone_ns": self.gone_ns,
            "object.is_gone": self.is_gone.astype(np.int64),
        }


def records_in(arrays: Mapping[str, NDArray[Any]], ids: Sequence[str], n_keys: int) -> ObjectRecords:
    """The records in a file's arrays with the names and shapes of `SCHEMA`, of a session of `n_keys` key scans.

    Raises ValueError: they do not fit each other, or an anchor is no key scan.
    """
    anchor = arrays["object.anchor"]
    if any(len(arrays[name]) != len(ids) for name in SCHEMA):
        raise ValueError("its objects do not fit each other")
    if len(anchor) and not (anchor.min() >= 0 and anchor.max() < n_keys):
        raise ValueError("an object without a key scan")
    covariances = unpacked(arrays["object.covariance"])
    if len(covariances) and np.linalg.eigvalsh(covariances)[:, 0].min() < -1e-6:
        raise ValueError("an object's covariance is not positive")
    return ObjectRecords(
        tuple(ids),
        anchor,
        poses=arrays["object.pose"],
        covariances=covariances,
        stamps_ns=arrays["object.stamps_ns"],
        reads=arrays["object.reads"],
        gain=arrays["object.gain"],
        closed_yaw=np.where(arrays["object.has_closed_yaw"] > 0, arrays["object.closed_yaw"], np.nan),
        gone_ns=arrays["object.gone_ns"],
        is_gone=arrays["object.is_gone"] > 0,
    )
