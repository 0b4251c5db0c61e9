"""Writes trajectory.tum and the methods' tables as exact plain text; the same values give the same bytes."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from gridslam.core.files import write_atomic
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Table


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write lines `t x y z qx qy qz qw` in the order of the trajectory."""
    quaternions = quaternion_of_yaw(trajectory.poses[:, 2])
    lines = [
        f"{format_stamp(int(stamp))} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n"
        for stamp, (x, y, _), (qw, _, _, qz) in zip(
            trajectory.stamps_ns, trajectory.poses.tolist(), quaternions.tolist(), strict=True
        )
    ]
    write_atomic(path, "".join(lines).encode())


def write_table(path: Path, table: Table) -> None:
    """Write a CSV file with a header; floats in the shortest form that reads back exactly.

    A column `stamp_ns` of integers is written as `stamp`, in seconds with nine decimals.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    stamps = [column == "stamp_ns" for column in table.columns]
    writer.writerow(
        ["stamp" if is_stamp else column for column, is_stamp in zip(table.columns, stamps, strict=True)]
    )
    for row in table.rows:
        writer.writerow(
            [
                value if type(value) is float else _cell(value, is_stamp)  # a float is written as its repr
                for value, is_stamp in zip(row, stamps, strict=True)
            ]
        )
    write_atomic(path, buffer.getvalue().encode())


def _cell(value: object, is_stamp: bool) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return format_stamp(int(value)) if is_stamp else str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return "" if value is None else str(value)
