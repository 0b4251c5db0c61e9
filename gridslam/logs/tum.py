"""TUM trajectory files: `t x y z qx qy qz qw`, one pose a line, `#` begins a comment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gridslam.core.errors import InputError
from gridslam.core.messages import canonical_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.logs.rotations import yaw_of
from gridslam.logs.stamps import parse_stamp


def read_tum(path: Path) -> Trajectory:
    """The trajectory in the plane. InputError names the line that is wrong."""
    stamps, poses = [], []
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a trajectory ({error})") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        stamp = parse_stamp(words[0])
        try:
            x, y, _, qx, qy, qz, qw = (float(w) for w in words[1:])
        except ValueError:
            stamp = None
        if stamp is None:
            raise InputError(f"{path} line {number}: expected t x y z qx qy qz qw")
        stamps.append(stamp)
        poses.append((x, y, canonical_yaw(yaw_of((qw, qx, qy, qz)))))
    return Trajectory(np.array(stamps, np.int64), np.array(poses, np.float64).reshape(-1, 3))
