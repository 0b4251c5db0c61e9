"""Reads results and ground truth; of a result only what there is ground truth for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gridslam.core.errors import InputError
from gridslam.evaluation.inputs import Result, Truth
from gridslam.evaluation.readers.files import read_relations
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.readers.pose_topics import read_topic
from gridslam.evaluation.readers.run_files import (
    MAX_EVALUATED_CELLS,
    Paths,
    read_consistency,
    read_probability,
    read_truth_series,
    run_paths,
    truth_paths,
)
from gridslam.evaluation.readers.trajectory_formats import read_poses
from gridslam.maps.map_server import load_map

BAG_ENDINGS = (".mcap", ".db3", ".bag")


def load_truth(
    path: Path | None,
    map_path: Path | None = None,
    relations: Path | None = None,
    objects: Path | None = None,
    *,
    topic: str | None = None,
) -> Truth:
    """The ground truth in files. A folder of ground truth also gives the map and the objects that are not named.

    `topic` names the poses in a log: a topic, or two tf frames `map->base_link`.

    Raises InputError: a file is unreadable, or has no ground truth of its kind.
    """
    found = Paths(trajectory=path) if topic is not None else truth_paths(path) if path else Paths()
    map_path, objects = map_path or found.map_yaml, objects or found.objects
    series = read_truth_series(found.trajectory, topic) if found.trajectory else None
    return Truth(
        trajectory=series.trajectory if series else None,
        series=series,
        relations=read_relations(relations) if relations else None,
        occupancy=load_map(map_path, max_cells=MAX_EVALUATED_CELLS) if map_path else None,
        objects=read_objects(objects) if objects else None,
    )


def load_result(path: Path, truth: Truth, topic: str | None = None) -> Result:
    """The parts of a run directory, of a trajectory file, or of a topic of a log, for which there is ground truth.

    Raises InputError: there is no result, or one of its files is damaged.
    """
    if topic is None and path.is_file() and path.suffix in BAG_ENDINGS:
        raise InputError(
            f"{path}: a log; name the topic of its poses with --topic (gridslam info lists the topics)"
        )
    paths = Paths(trajectory=path) if topic is not None else run_paths(path)
    with_map = truth.occupancy is not None and paths.map_yaml is not None
    needs_trajectory = truth.trajectory is not None or truth.relations is not None
    series = None
    if paths.trajectory and needs_trajectory:
        series = _stamped(
            read_topic(path, topic, "--topic") if topic is not None else read_poses(paths.trajectory),
            truth.series,
        )
    return Result(
        trajectory=series.trajectory if series else None,
        series=series,
        occupancy=load_map(paths.map_yaml, max_cells=MAX_EVALUATED_CELLS)
        if with_map and paths.map_yaml
        else None,
        probability=read_probability(paths.layers) if with_map and paths.layers else None,
        objects=read_objects(paths.objects) if paths.objects and truth.objects is not None else None,
        consistency=read_consistency(path),
    )


def _stamped(series: PoseSeries, truth: PoseSeries | None) -> PoseSeries:
    """The series with the stamps of the ground truth if it has none of its own and as many poses.

    Raises InputError: only one of the two has stamps, and their numbers of poses differ.
    """
    if truth is None or series.has_stamps == truth.has_stamps:
        return series
    if len(series) != len(truth):
        without = truth.name if series.has_stamps else series.name
        raise InputError(
            f"{without} has no stamps, and the numbers of poses differ: {len(series)} in {series.name}, {len(truth)} in "
            f"{truth.name}; give a file with stamps"
        )
    note = f"has no stamps: its poses are paired with those of {truth.name} in order"
    if series.has_stamps:
        return replace(
            series, stamps_ns=truth.stamps_ns, notes=(*series.notes, f"paired with {truth.name} in order")
        )
    return replace(series, stamps_ns=truth.stamps_ns, has_stamps=True, notes=(*series.notes, note))
