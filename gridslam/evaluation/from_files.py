"""Reads results and ground truth; of a result only what there is ground truth for."""

from __future__ import annotations

from pathlib import Path

from gridslam.evaluation.document import Result, Truth
from gridslam.evaluation.files import read_relations, read_trajectory
from gridslam.evaluation.object_files import read_objects
from gridslam.evaluation.run_files import Paths, read_probability, read_truth, run_paths, truth_paths
from gridslam.maps.map_server import load_map


def load_truth(
    path: Path | None,
    map_path: Path | None = None,
    relations: Path | None = None,
    objects: Path | None = None,
) -> Truth:
    """The ground truth in files. A folder of ground truth also gives the map and the objects that are not named.

    Raises InputError: a file is unreadable, or has no ground truth of its kind.
    """
    found = truth_paths(path) if path else Paths()
    map_path, objects = map_path or found.map_yaml, objects or found.objects
    return Truth(
        trajectory=read_truth(found.trajectory) if found.trajectory else None,
        relations=read_relations(relations) if relations else None,
        occupancy=load_map(map_path) if map_path else None,
        objects=read_objects(objects) if objects else None,
    )


def load_result(path: Path, truth: Truth) -> Result:
    """The parts of a run directory, or of a trajectory file, for which there is ground truth.

    Raises InputError: there is no result, or one of its files is damaged.
    """
    paths = run_paths(path)
    with_map = truth.occupancy is not None and paths.map_yaml is not None
    needs_trajectory = truth.trajectory is not None or truth.relations is not None
    return Result(
        trajectory=read_trajectory(paths.trajectory) if paths.trajectory and needs_trajectory else None,
        occupancy=load_map(paths.map_yaml) if with_map and paths.map_yaml else None,
        probability=read_probability(paths.layers) if with_map and paths.layers else None,
        objects=read_objects(paths.objects) if paths.objects and truth.objects is not None else None,
    )
