"""The map of a session as it was drawn last, in session.npz: only its known cells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.sessions.changes import Change, change_of
from gridslam.lidar_slam.sessions.drawn_state import DrawnState
from gridslam.lidar_slam.sessions.evidence import CellFrame

Arrays = dict[str, NDArray[Any]]

SCHEMA = {
    "drawn.known": ("|u1", 0),  # one bit a cell
    "drawn.log_odds": ("<f4", 0),  # of the known cells, as all that follows
    "drawn.hits": ("<u2", 0),
    "drawn.misses": ("<u2", 0),
    "drawn.layer": ("<i2", 0),
    "drawn.pose": ("<f8", 3),
    "change.drive": ("<i8", 0),
    "change.has_vanished": ("<i8", 0),
    "change.cells": ("<i8", 0),
    "change.stamps_ns": ("<i8", 2),
    "change.cell": ("<i8", 2),
}
MAX_COUNT = 65535
MAX_CELLS = 1 << 25  # 290 m x 290 m at 5 cm, in 16 bytes each; a larger map is drawn anew
MAX_CORNER = 1 << 40  # cells from the origin
MIN_RESOLUTION_M, MAX_RESOLUTION_M = 1e-4, 1e3


def frame_document(frame: CellFrame) -> dict[str, Any]:
    """The frame as JSON."""
    x, y = frame.corner.tolist()
    return {"x": x, "y": y, "rows": frame.rows, "cols": frame.cols, "resolution_m": frame.resolution_m}


def drawn_arrays(drawn: DrawnState) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Pairs (name, array) of a drawn map, as they are stored: the values of its known cells `(k,)`, and its changes."""
    known = ~np.isnan(drawn.log_odds)
    yield "drawn.known", np.packbits(known)
    yield "drawn.log_odds", drawn.log_odds[known]
    yield "drawn.hits", np.minimum(drawn.state.hits[known], MAX_COUNT).astype("<u2")
    yield "drawn.misses", np.minimum(drawn.state.misses[known], MAX_COUNT).astype("<u2")
    yield "drawn.layer", drawn.layer[known]
    yield "drawn.pose", drawn.poses
    changes = drawn.changes
    yield "change.drive", np.array([change.drive for change in changes], np.int64)
    yield "change.has_vanished", np.array([change.kind == "vanished" for change in changes], np.int64)
    yield "change.cells", np.array([len(change.cells) for change in changes], np.int64)
    stamps = np.array([(change.before_ns, change.after_ns) for change in changes], np.int64)
    yield "change.stamps_ns", stamps.reshape(-1, 2)
    cells = [np.zeros((0, 2), np.int64), *(change.cells for change in changes)]
    yield "change.cell", np.concatenate(cells).astype(np.int64)


def drawn_in(a: Arrays, document: Any, first_key: NDArray[np.int64]) -> DrawnState:
    """The map from arrays of the right types, the reverse of `drawn_arrays`; drive d begins at key scan first_key[d] `(d + 1,)`.

    Raises ValueError: the arrays do not fit each other or the drives.
    """
    frame = _frame_in(document)
    size = frame.rows * frame.cols
    if len(a["drawn.known"]) != -(-size // 8):
        raise ValueError("the drawn map is of another size")
    known = np.unpackbits(a["drawn.known"], count=size).astype(np.bool_).reshape(frame.rows, frame.cols)
    grids = ("drawn.log_odds", "drawn.hits", "drawn.misses", "drawn.layer")
    if any(len(a[name]) != known.sum() for name in grids) or len(a["drawn.pose"]) not in first_key[1:]:
        raise ValueError("the drawn map does not fit the drives")
    drawn = DrawnState.nothing(frame)
    state = drawn.state
    targets: list[NDArray[Any]] = [drawn.log_odds, state.hits, state.misses, drawn.layer]
    for grid, name in zip(targets, grids, strict=True):
        grid[known] = a[name]
    return replace(drawn, changes=_changes_in(a, frame, len(first_key) - 1), poses=a["drawn.pose"])


def _frame_in(document: Any) -> CellFrame:
    """Raises ValueError: a number of the frame is missing or out of range."""
    try:
        x, y, rows, cols = (document[name] for name in ("x", "y", "rows", "cols"))
        resolution_m = document["resolution_m"]
    except (KeyError, TypeError):
        raise ValueError("the drawn map has no frame") from None
    if not all(type(value) is int for value in (x, y, rows, cols)) or not isinstance(resolution_m, float):
        raise ValueError("the drawn map's frame has no numbers")
    if not (
        max(abs(x), abs(y)) <= MAX_CORNER
        and min(rows, cols) >= 1
        and rows * cols <= MAX_CELLS
        and MIN_RESOLUTION_M <= resolution_m <= MAX_RESOLUTION_M
    ):
        raise ValueError("the drawn map's frame is out of range")
    return CellFrame(np.array([x, y], np.int64), rows, cols, resolution_m)


def _changes_in(a: Arrays, frame: CellFrame, drives: int) -> list[Change]:
    counts, cells = a["change.cells"], a["change.cell"]
    columns = ("change.drive", "change.has_vanished", "change.stamps_ns")
    if any(len(a[name]) != len(counts) for name in columns) or (counts < 1).any():
        raise ValueError("its changes do not fit each other")
    drive = a["change.drive"]
    if counts.sum() != len(cells) or ((drive < 1) | (drive >= drives)).any():
        raise ValueError("its changes do not fit the drives")
    if len(cells) and (cells.min() < 0 or (cells.max(axis=0) >= [frame.rows, frame.cols]).any()):
        raise ValueError("a changed cell lies outside the map")
    groups = np.split(cells, np.cumsum(counts)[:-1]) if len(counts) else []
    return [
        change_of("vanished" if gone else "appeared", d, own, (before, after), frame)
        for d, gone, own, (before, after) in zip(
            drive.tolist(),
            a["change.has_vanished"].tolist(),
            groups,
            a["change.stamps_ns"].tolist(),
            strict=True,
        )
    ]
