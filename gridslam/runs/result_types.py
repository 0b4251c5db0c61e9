"""Checks of the types and values in a method's result; methods of other packages can return anything."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from numbers import Real

import numpy as np

from gridslam.core.errors import MethodError
from gridslam.core.poses import MAX_COORDINATE_M
from gridslam.core.stamps import END_NS
from gridslam.core.trajectory import Trajectory
from gridslam.maps.image_levels import MAX_PIXELS
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods.base import Picture, RunResult, Series, Table
from gridslam.methods.packaged import naming
from gridslam.runs.packaged_results import packaged_problems

_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
_NAMED = {
    "maps": OccupancyGrid,
    "pictures": Picture,
    "tables": Table,
    "trajectories": Trajectory,
    "files": bytes,
}
# Names that files of the run itself have
_TAKEN = {"maps": "map", "pictures": "map", "trajectories": "trajectory"}
_MAX_SIDE = 1_000_000  # cells; every row and column of a picture takes additional memory
_KEYED = {"layers": GridLayer, "series": Series}


def refuse_wrong_result(method: str, result: object, is_packaged: bool) -> None:
    """Raises MethodError for the first part of a result that cannot be written.

    Such a part has another type than in `RunResult`, poses or a grid that are not finite, stamps that no format can store, too
    many cells, or a name that cannot be the name of a file in the run directory. If the method `is_packaged` (in another
    package), all parts are checked, and stamps must ascend.
    """
    with naming(method if is_packaged else ""):
        for problem in _problems(result, is_packaged):
            raise MethodError(f"{method}: the result {problem}")


def _problems(result: object, is_packaged: bool) -> Iterator[str]:
    """Faults of a result, in words that follow "the result"; later checks rely on earlier ones."""
    if not isinstance(result, RunResult):
        yield f"is of type {type(result).__name__}, expected RunResult"
        return
    for kind, part_type in (_NAMED | _KEYED).items():
        parts = getattr(result, kind)
        if not isinstance(parts, Mapping) or not all(isinstance(part, part_type) for part in parts.values()):
            yield f"has {kind} that are not a mapping of names to {part_type.__name__}"
        for name in parts if kind in _NAMED else ():
            if not isinstance(name, str) or not _FILE_NAME.fullmatch(name) or name == _TAKEN.get(kind):
                yield (
                    f"has {kind} of the name {name!r}, which cannot be written: letters, digits, '-', '_' and '.' make a "
                    f"name, and {' and '.join(sorted(set(_TAKEN.values())))} are of the run"
                )
    for trajectory in (result.trajectory, *result.trajectories.values()):
        yield from _problems_of_trajectory(trajectory)
    for grid in (result.occupancy, *result.maps.values()):
        if grid is not None:
            yield from _problems_of_map(grid)
    for picture in result.pictures.values():
        rgb = picture.rgb
        if not isinstance(rgb, np.ndarray) or rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
            yield "has pictures that are not uint8 (height, width, 3)"
    if is_packaged:
        yield from packaged_problems(result)


def _problems_of_trajectory(trajectory: object) -> Iterator[str]:
    if not isinstance(trajectory, Trajectory):
        yield f"has a trajectory of type {type(trajectory).__name__}, expected Trajectory"
        return
    stamps, poses = np.asarray(trajectory.stamps_ns), np.asarray(trajectory.poses)
    if poses.dtype.kind not in "fiu" or (stamps.size and stamps.dtype.kind not in "iu"):
        yield "has poses that are not numbers, or stamps that are not integers"
    elif not np.isfinite(poses).all():
        yield "has poses that are not finite"
    elif np.abs(poses.astype(np.float64)).max(initial=0.0) > MAX_COORDINATE_M:
        yield f"has poses beyond {MAX_COORDINATE_M:g} m"
    elif (stamps < 0).any():
        yield "has negative stamps"
    elif (stamps >= END_NS).any():
        yield "has stamps from 2^31 s on"


def _problems_of_map(grid: object) -> Iterator[str]:
    if not isinstance(grid, OccupancyGrid):
        yield f"has a map of type {type(grid).__name__}, expected OccupancyGrid"
        return
    values = grid.probability
    if not isinstance(values, np.ndarray) or values.ndim != 2 or values.dtype.kind != "f":
        yield "has a map that is not an array of floats (rows, cols)"
    elif values.size > MAX_PIXELS:
        yield f"has a map of {values.shape[0]} x {values.shape[1]} cells; the limit is {MAX_PIXELS}"
    elif max(values.shape) > _MAX_SIDE:
        yield f"has a map of {values.shape[0]} x {values.shape[1]} cells; the limit of a side is {_MAX_SIDE}"
    elif not _is_usable(grid.geometry):
        yield "has a map whose geometry is not a GridGeometry of finite numbers"
    elif values.size and not (np.fmin.reduce(values, axis=None) >= 0.0 or np.isnan(values).all()):
        yield "has a map with probabilities below 0"
    elif values.size and np.fmax.reduce(values, axis=None) > 1.0:
        yield "has a map with probabilities above 1"


def _is_usable(geometry: object) -> bool:
    if not isinstance(geometry, GridGeometry) or len(geometry.origin_xy_m) != 2:
        return False
    numbers = (geometry.resolution_m, *geometry.origin_xy_m, geometry.yaw_rad)
    are_finite = all(isinstance(n, Real) and math.isfinite(n) and abs(n) <= MAX_COORDINATE_M for n in numbers)
    return are_finite and geometry.resolution_m > 0.0
