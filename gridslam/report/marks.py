"""Marks on the poses of a run (distrusted ones, uncertainty, loops), for the pictures and lists of the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.preview import PathMarks
from gridslam.methods.base import RunResult

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAX_STRETCHES = 20  # largest number of stretches in the list


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the path that the method does not trust: times since the start (s), and position of its first pose."""

    first_s: float
    last_s: float
    x_m: float
    y_m: float


def marks_of(result: RunResult) -> PathMarks:
    """The marks on the path of a result."""
    path = result.trajectory
    if not len(path):
        return PathMarks()
    untrusted = np.zeros(len(path), np.bool_)
    for first, last in result.untrusted_ns:
        untrusted |= (path.stamps_ns >= first) & (path.stamps_ns <= last)
    std = np.full(len(path), np.nan)
    if result.position_std is not None and len(result.position_std.stamps_ns):
        known = result.position_std
        order = np.argsort(known.stamps_ns, kind="stable")
        std = np.interp(path.stamps_ns, known.stamps_ns[order], known.values[order])
        std[untrusted] = np.nan
    return PathMarks(untrusted, std, _positions_at(path, result.loops_ns))


def untrusted_stretches(result: RunResult) -> Iterator[Stretch]:
    """The longest parts of the path that the method does not trust, in the order of their stamps."""
    path, spans = result.trajectory, result.untrusted_ns
    if not len(path) or not len(spans):
        return
    start = int(path.stamps_ns.min())
    longest = np.sort(np.argsort(spans[:, 0] - spans[:, 1], kind="stable")[:MAX_STRETCHES])
    for (first, last), (x, y) in zip(
        spans[longest].tolist(), _positions_at(path, spans[longest])[:, 0], strict=True
    ):
        yield Stretch((first - start) / 1e9, (last - start) / 1e9, float(x), float(y))


def _positions_at(path: Trajectory, stamps_ns: Ints) -> Floats:
    """Positions `(k, 2, 2)` of the poses nearest to pairs of stamps `(k, 2)`."""
    if not len(stamps_ns):
        return np.zeros((0, 2, 2))
    order = np.argsort(path.stamps_ns, kind="stable")
    stamps = path.stamps_ns[order]
    after = np.clip(np.searchsorted(stamps, stamps_ns), 1, max(len(stamps) - 1, 1))
    is_before = stamps_ns - stamps[after - 1] < stamps[np.minimum(after, len(stamps) - 1)] - stamps_ns
    nearest = np.where(is_before, after - 1, np.minimum(after, len(stamps) - 1))
    return np.asarray(path.poses[order[nearest], :2])
