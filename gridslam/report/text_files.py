"""Writes trajectory.tum and the methods' tables as exact plain text; the same values give the same bytes."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gridslam.core.files import write_atomic
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Table

ROWS_PER_BLOCK = 10_000  # rows written at once, so that a long file is never in memory as a whole


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write lines `t x y z qx qy qz qw` in the order of the trajectory."""
    starts = range(0, len(trajectory), ROWS_PER_BLOCK)
    write_atomic(
        path, (_tum_lines(trajectory, slice(start, start + ROWS_PER_BLOCK)).encode() for start in starts)
    )


def _tum_lines(trajectory: Trajectory, part: slice) -> str:
    """The lines of a part of the poses."""
    stamps, poses = trajectory.stamps_ns[part], trajectory.poses[part]
    quaternions = quaternion_of_yaw(poses[:, 2])
    return "".join(
        f"{format_stamp(int(stamp))} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n"
        for stamp, (x, y, _), (qw, _, _, qz) in zip(stamps, poses.tolist(), quaternions.tolist(), strict=True)
    )


def write_table(path: Path, table: Table) -> None:
    """Write a CSV file with a header; floats in the shortest form that reads back exactly.

    A column `stamp_ns` of integers is written as `stamp`, in seconds with nine decimals.
    """
    write_atomic(path, _csv_blocks(table))


def _csv_blocks(table: Table) -> Iterator[bytes]:
    """The bytes of a table's CSV file, in blocks of rows."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    stamps = [column == "stamp_ns" for column in table.columns]
    writer.writerow(
        ["stamp" if is_stamp else column for column, is_stamp in zip(table.columns, stamps, strict=True)]
    )
    for number, row in enumerate(table.rows, start=1):
        writer.writerow(
            [
                value if type(value) is float else _cell(value, is_stamp)  # a float is written as its repr
                for value, is_stamp in zip(row, stamps, strict=True)
            ]
        )
        if not number % ROWS_PER_BLOCK:
            yield buffer.getvalue().encode()
            buffer.seek(0)
            buffer.truncate()
    yield buffer.getvalue().encode()


def _cell(value: object, is_stamp: bool) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return format_stamp(int(value)) if is_stamp else str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return "" if value is None else str(value)
