"""CARMEN logs and tables alone with changed words and lines, plain or packed."""

from __future__ import annotations

import bz2
import gzip
import random
from pathlib import Path
from typing import Any

from gridslam.logs.config import LogConfig, LogLimits
from tests.fuzz.damage import NUMBERS, changed
from tests.fuzz.value_trees import damaged

WORDS = (
    *NUMBERS, "5", "-5", "99999", "1e-320", "9" * 400, "\x1b[31m", "\u0661", "FLASER", "ODOM", "PARAM", "ROBOTLASER1", "#", "\0",
)  # fmt: skip
RANGES = "1 2 3 4 5"
LIMITS = LogLimits(chunk_mb=16, line_mb=1, reorder_mb=16)
TABLE: dict[str, Any] = {
    "streams": [
        {
            "kind": "scan", "file": "log.table", "columns": {"stamp": "t", "r": "d"}, "units": {"stamp": "ms", "r": "mm"},
            "constants": {"angle_min": -1.0, "angle_increment": 0.1, "range_min": 50, "range_max": 30000},
        },
        {
            "kind": "odom", "file": "log.table", "columns": {"stamp": "t"}, "units": {"stamp": "ms", "yaw": "deg"},
            "invalid": [0.0],
        },
    ]
}  # fmt: skip


def fuzz_carmen(path: Path, sample: Path, rng: random.Random) -> Path:
    """Laser and odometry lines of all forms, of which a few words are others."""
    lines = ["PARAM robot_front_laser_max 81.9 nohost 0"]
    for k in range(rng.randrange(1, 12)):
        pose, tail = f"{0.1 * k:.2f} 0 0.01", f"{1000 + 0.1 * k:.3f} host {0.1 * k:.3f}"
        robot = (
            f"ROBOTLASER1 0 -1.57 3.14 0.0174 81.9 0.01 0 5 {RANGES} 0 {pose} {pose} 0.1 0 0.3 0.3 1 {tail}"
        )
        forms = (
            f"FLASER 5 {RANGES} {pose} {pose} {tail}", robot, f"RAWLASER1 0 -1.57 3.14 0.0174 81.9 0.01 0 5 {RANGES} 0 {tail}",
            f"ODOM {pose} 0.1 0 0 {tail}", f"TRUEPOS {pose} {pose} {tail}", f"RLASER 5 {RANGES} {pose} {pose} {tail}",
        )  # fmt: skip
        lines.append(rng.choice(forms))
    return _written(path, _with_other_words(lines, " ", rng), rng)


def fuzz_table(path: Path, sample: Path, rng: random.Random) -> Path:
    """A table of scans and odometry in one."""
    lines = ["t,x,y,yaw," + ",".join(f"d{i}" for i in range(5))]
    ranges = RANGES.replace(" ", "000,") + "000"
    lines += [f"{1_000_000 + 100 * k},{0.1 * k:.2f},0,{k},{ranges}" for k in range(rng.randrange(1, 12))]
    return _written(path.with_name("log.table"), _with_other_words(lines, ",", rng), rng, packed=0.0)


def table_config(rng: random.Random) -> LogConfig:
    """The layout of the table, changed in one of three. Raises ValidationError: it is none."""
    layout = damaged(TABLE, rng) if rng.random() < 0.3 else TABLE
    return LogConfig.model_validate({"csv": layout, "limits": LIMITS})


def _with_other_words(lines: list[str], separator: str, rng: random.Random) -> bytes:
    """The lines with a few words changed, moved or left out, and lines repeated, joined or cut."""
    rows = [line.split(separator) for line in lines]
    for _ in range(rng.choice((0, 1, 2, 4))):
        row = rng.choice(rows)
        if row and rng.random() < 0.7:
            row[rng.randrange(len(row))] = rng.choice((*WORDS, rng.choice(rng.choice(rows) or [""])))
        elif row and rng.random() < 0.5:
            row.pop(rng.randrange(len(row)))
        else:
            rows[rng.randrange(len(rows))] = rng.choice(([], [""], row * 2, row[:-1], [*row, "1"], row))
    data = "\n".join(separator.join(row) for row in rows).encode() + b"\n"
    return changed(data, rng) if rng.random() < 0.15 else data


def _written(path: Path, data: bytes, rng: random.Random, packed: float = 0.3) -> Path:
    """The file, some packed and some of these damaged."""
    if rng.random() < packed:
        data = rng.choice((lambda d: gzip.compress(d, 1, mtime=0), bz2.compress))(data)
        data = changed(data, rng) if rng.random() < 0.3 else data
    path.write_bytes(data)
    return path
