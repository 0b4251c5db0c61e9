"""Finds and reads the files of a run directory or of ground truth."""

from __future__ import annotations

import codecs
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import InputError
from gridslam.core.numpy_files import read_npz
from gridslam.core.plain_files import MAX_JSON_BYTES, open_plain_file, read_plain_file
from gridslam.core.texts import is_number
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.readers.pose_topics import read_topic
from gridslam.evaluation.readers.trajectory_formats import read_poses
from gridslam.maps.map_yaml import MAX_ORIGIN
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

TRAJECTORY = "trajectory.tum"
MAP = "map.yaml"
LAYERS = "layers.npz"
OBJECTS = "objects.csv"
REPORT = "report.json"
_TEXT_ENDINGS = frozenset({".tum", ".txt", ".csv"})
_HEAD_BYTES = 1 << 16
# 400 m x 400 m at 5 cm. Evaluating such a map, with its layer and a true map of that size, takes 1 GB of memory.
MAX_EVALUATED_CELLS = 64_000_000
MAX_LAYER_BYTES = 4 * MAX_EVALUATED_CELLS + (1 << 12)  # float32 values and the header of the array


@dataclass(frozen=True, slots=True)
class Paths:
    """The files of a run or of ground truth; None for missing ones. `trajectory` can be a log that holds true poses."""

    trajectory: Path | None = None
    map_yaml: Path | None = None
    layers: Path | None = None
    objects: Path | None = None


def run_paths(path: Path) -> Paths:
    """The files of a run directory or of a folder of ground truth; a path to a file is taken as the trajectory.

    Raises InputError: the path does not exist, or is a folder without any of the files.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; expected a run directory or a trajectory")
    if not path.is_dir():
        return Paths(trajectory=path)
    trajectory, map_yaml, layers, objects = (
        path / name if (path / name).is_file() else None for name in (TRAJECTORY, MAP, LAYERS, OBJECTS)
    )
    if trajectory is None and map_yaml is None and objects is None:
        raise InputError(f"{path}: neither {TRAJECTORY} nor {MAP} nor {OBJECTS} in this folder")
    return Paths(trajectory, map_yaml, layers, objects)


def run_command_of(path: Path) -> str | None:
    """The command that wrote a run directory (`map`, `localize`, `explore`), from its report; None if it has no report."""
    command = _report_of(path).get("command")
    return command if isinstance(command, str) else None


def read_consistency(path: Path) -> dict[str, float | bool] | None:
    """The measures of map consistency in the report of a run directory, by name; None if it has none."""
    measures = _report_of(path).get("measures")
    found = measures.get("map_consistency") if isinstance(measures, dict) else None
    if not isinstance(found, dict):
        return None
    return {name: value for name, value in found.items() if isinstance(value, int | float)}


def _report_of(path: Path) -> dict[str, Any]:
    """The report of a run directory; empty if there is none, or it cannot be read."""
    try:
        document = json.loads(read_plain_file(path / REPORT, MAX_JSON_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def truth_paths(path: Path) -> Paths:
    """The files of ground truth at a path, as from `run_paths`, except that a folder without any of them is taken as a log."""
    if path.is_dir() and not any((path / name).is_file() for name in (TRAJECTORY, MAP, OBJECTS)):
        return Paths(trajectory=path)
    return run_paths(path)


def read_truth_series(path: Path, topic: str | None = None) -> PoseSeries:
    """The poses on a topic of a log or, without `topic`, those of a trajectory file or the true poses in a log.

    Raises InputError: the file is unreadable or damaged, or the log has no true poses.
    """
    if topic is not None:
        return read_topic(path, topic)
    if path.is_file() and _looks_like_trajectory(path):
        return read_poses(path)
    from gridslam.logs.open import open_log

    with open_log(path) as log:
        truth = log.truth()
    if truth is None or not len(truth):
        raise InputError(
            f"{path}: this log holds no true poses; name a topic with --truth-topic, or give a trajectory"
        )
    return PoseSeries.of(path.name, truth)


def _looks_like_trajectory(path: Path) -> bool:
    """Whether the name has the suffix of a text file, or the first line that is not a comment starts with a number.

    A file without any such line is taken as an empty trajectory if its name has no suffix. Raises InputError: it is unreadable.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    for line in head.removeprefix(codecs.BOM_UTF8).split(b"\n"):
        words = line.partition(b"#")[0].replace(b",", b" ").split()
        if words:
            return is_number(words[0]) or path.suffix.lower() in _TEXT_ENDINGS
    return path.suffix.lower() in _TEXT_ENDINGS | {""}


def read_probability(path: Path) -> OccupancyGrid | None:
    """The layer `probability` of a layers.npz; None if it has none. Raises InputError: file or layer are damaged or too large."""
    names = ("probability", "probability.origin", "probability.resolution")
    try:
        with open_plain_file(path) as stream:
            layers = read_npz(stream, MAX_LAYER_BYTES, names)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not the layers of a run ({error}); run again") from None
    if "probability" not in layers:
        return None
    values, origin, resolution = (layers.get(name, np.zeros(0)) for name in names)
    if not (_are_numbers(values, 2) and _are_numbers(origin, 1) and _are_numbers(resolution, 0)):
        raise InputError(f"{path}: probability: expected rows and columns with a resolution; run again")
    cell_m, corner = float(resolution), origin.astype(np.float64).tolist()
    is_sound = len(corner) == 3 and all(abs(v) <= MAX_ORIGIN for v in corner) and 1e-4 <= cell_m <= 1e3
    # By rows: masks of the whole layer would take as much memory again.
    if not is_sound or any((row < 0.0).any() or (row > 1.0).any() for row in values):
        raise InputError(f"{path}: probability: values, origin or resolution out of range; run again")
    x, y, yaw = corner
    return OccupancyGrid(values.astype(np.float32, copy=False), GridGeometry(cell_m, (x, y), yaw))


def _are_numbers(values: NDArray[np.generic], dimensions: int) -> bool:
    """Whether an array has this many dimensions, and holds integers or floats."""
    return values.ndim == dimensions and values.dtype.kind in "fiu"
