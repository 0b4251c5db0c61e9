"""Reader of relations, one per line. A wrong line is an error that names the line."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gridslam.core.errors import InputError
from gridslam.evaluation.relations import Relations
from gridslam.logs.tum import lines_of, numbers_in, read_trajectory, stamp_in

__all__ = ["read_relations", "read_trajectory"]

_RELATION_WORDS = 8
_RELATION_LINE = "t1 t2 x y z roll pitch yaw"


def read_relations(path: Path) -> Relations:
    """Relations of a file with lines `t1 t2 x y z roll pitch yaw`; z, roll and pitch are ignored. Raises InputError."""
    stamps: list[tuple[int, int]] = []
    motions: list[tuple[float, float, float]] = []
    for place, words in lines_of(path, _RELATION_LINE):
        if len(words) != _RELATION_WORDS:
            raise InputError(f"{place}: {len(words)} numbers; expected {_RELATION_LINE}")
        stamps.append((stamp_in(place, words[0]), stamp_in(place, words[1])))
        x, y, _, _, _, yaw = numbers_in(place, words[2:])
        motions.append((x, y, yaw))
    if not stamps:
        raise InputError(f"{path}: no relations; expected lines {_RELATION_LINE}")
    ends = np.array(stamps, np.int64)
    return Relations(ends[:, 0], ends[:, 1], np.array(motions))
