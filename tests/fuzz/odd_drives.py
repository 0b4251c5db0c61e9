"""Whole runs over drives whose numbers contradict each other: stamps, units, angles, axes, odometry, truth."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from tests.small_log import wall_ranges

Floats = NDArray[np.float64]

STARTS_S = (0.0, 0.05, 1e3, 1.7e9, 1.7e9, 1.7e9, 2.147483e9)
SECONDS = (1e-9, 0.003, 0.05, 0.3, 2.0, 50.0, 1e6)
ODD = (float("nan"), float("inf"), 0.0, -1.0, 1e5, 1e7, 1e300, 1e-300)


@dataclass
class OddDrive:
    """Stamps `(n,)` and odometry `(n, 3)`, stamps `(m,)` and ranges `(m, beams)` of scans, and the numbers of all scans."""

    odom_s: Floats
    odom: Floats
    scan_s: Floats
    ranges: Floats
    limits: dict[str, float]
    extrinsics: dict[str, float] = field(default_factory=dict)


def drive_of(rng: random.Random) -> OddDrive:
    """A robot that drives a circle in a room."""
    scans, beams = rng.choice((1, 2, 30, 70, 70, 70)), rng.choice((1, 2, 40, 90, 90))
    start_s, angles = rng.choice(STARTS_S), -np.pi + 2 * np.pi * np.arange(beams) / beams
    scan_s = 0.1 * np.arange(scans)
    phase = 0.09 * np.arange(scans)
    poses = np.column_stack([np.cos(phase), np.sin(phase), phase + np.pi / 2])
    ranges = np.array([wall_ranges(x, y, yaw + angles) for x, y, yaw in poses.tolist()])
    limits = {"angle_min": -np.pi, "angle_increment": 2 * np.pi / beams, "range_min": 0.05, "range_max": 20.0}
    return OddDrive(start_s + scan_s, poses, start_s + scan_s + 0.02, ranges, limits)


def _rows(values: Floats, rng: random.Random) -> slice:
    """All rows, or some that follow each other."""
    first = rng.randrange(len(values))
    return rng.choice((slice(None), slice(first, first + 1), slice(first, None)))


def _stamps(drive: OddDrive, rng: random.Random) -> None:
    stamps = rng.choice((drive.odom_s, drive.scan_s))
    rows, how = _rows(stamps, rng), rng.randrange(5)
    if how == 0:
        stamps[rows] += rng.choice(SECONDS) * rng.choice((1, -1))
    elif how == 1:
        stamps[rows] = stamps[rows][0]
    elif how == 2:
        stamps[rows] = stamps[rows][::-1].copy()
    elif how == 3:
        stamps[rows] = np.floor(stamps[rows] / rng.choice((1.0, 0.3)))
    else:
        stamps[rows] = stamps[0] + (stamps[rows] - stamps[0]) * rng.choice((1e-6, 1e-3, 3.0, 1e3, 1e6))


def _odometry(drive: OddDrive, rng: random.Random) -> None:
    odom = drive.odom
    rows, how = _rows(odom, rng), rng.randrange(6)
    if how == 0:
        odom[rows] *= rng.choice(
            ([0.8, 0.8, 1], [1, -1, -1], [1e3, 1e3, 1], [1, 1, 57.3], [0, 0, 0], [1e-3, 1e-3, 1], [1, 1, -1])
        )
    elif how == 1:
        odom[rows] = odom[rows][:, rng.choice(([1, 0, 2], [2, 1, 0]))]
    elif how == 2:
        odom[rows] += rng.choice(([1e5, 0, 0], [0, 0, 3.0], [0.5, 0.5, 0.5], [9e6, 9e6, 0], [0, 0, 1e9]))
    elif how == 3:
        odom[rows] = odom[rows][0]
    else:
        odom[rows, rng.randrange(3)] = rng.choice(ODD)


def _ranges(drive: OddDrive, rng: random.Random) -> None:
    ranges = drive.ranges
    rows, how = _rows(ranges, rng), rng.randrange(6)
    if how == 0:
        ranges[rows] *= rng.choice((1e3, 1e-3, 0.01, -1.0, 1e6))
    elif how == 1:
        ranges[rows] = rng.choice((*ODD, 0.05, 20.0, 3.0))
    elif how == 2:
        ranges[rows, rng.randrange(ranges.shape[1]) :] = rng.choice(ODD)
    elif how == 3:
        ranges[rows] = np.random.default_rng(rng.randrange(99)).uniform(0, 20, ranges.shape)[rows]
    elif how == 4:
        ranges[ranges > 3.0] = rng.choice((51.06, 20.0, 65.535, 0.0))
    else:
        ranges[rows] = ranges[rows, ::-1].copy()


def _limits(drive: OddDrive, rng: random.Random) -> None:
    name = rng.choice(list(drive.limits))
    drive.limits[name] = rng.choice((drive.limits[name] * rng.choice((0.5, 2.0, 57.3, -1.0, 1e-6)), *ODD))


def _place(drive: OddDrive, rng: random.Random) -> None:
    name = rng.choice(("x", "y", "yaw", "roll", "z"))
    drive.extrinsics[name] = rng.choice((0.3, np.pi, -np.pi / 2, 1e3, 1e6, 1e12, 1e300))


CHANGES: Mapping[str, Callable[[OddDrive, random.Random], None]] = MappingProxyType(
    {"stamps": _stamps, "odometry": _odometry, "ranges": _ranges, "limits": _limits, "place": _place}
)


def write_odd_drive(folder: Path, rng: random.Random) -> Path:
    """A folder of tables of a drive in which up to three things are changed; some have a gyro, and some a truth."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    drive = drive_of(rng)
    truth = drive.odom.copy()
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        CHANGES[rng.choice(list(CHANGES))](drive, rng)
    if rng.random() < 0.9:
        _write(folder / "odom.csv", "stamp,x,y,yaw", drive.odom_s, drive.odom)
    names = [*drive.limits, *(f"r{i}" for i in range(drive.ranges.shape[1]))]
    limits = np.tile(list(drive.limits.values()), (len(drive.scan_s), 1))
    _write(folder / "scan.csv", ",".join(["stamp", *names]), drive.scan_s, np.hstack([limits, drive.ranges]))
    if rng.random() < 0.3:
        rates = np.full((len(drive.odom_s), 1), rng.choice((0.9, 0.9, -0.9, 51.6, 0.0, *ODD)))
        _write(folder / "imu.csv", "stamp,wz", drive.odom_s, rates)
    if rng.random() < 0.3:
        _write(folder / "truth.csv", "stamp,x,y,yaw", drive.odom_s, truth)
    (folder / "log.yaml").write_text(f"extrinsics: {{laser: {drive.extrinsics or '{}'}}}\n")
    return folder


def _write(path: Path, header: str, stamps_s: Floats, values: Floats) -> None:
    lines = [
        f"{stamp:.9f}," + ",".join(f"{value!r}" for value in row)
        for stamp, row in zip(stamps_s.tolist(), values.tolist(), strict=True)
    ]
    path.write_text("\n".join([header, *lines]) + "\n")
