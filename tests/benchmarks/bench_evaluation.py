"""Time of APE, RPE and relations relative to evo's for the same measures, and of the measures of a large map."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from evo.core import metrics, sync
from evo.core.metrics import PoseRelation
from evo.core.trajectory import PoseTrajectory3D

from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.document import evaluate
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.map_errors import wall_distances
from gridslam.evaluation.relations import Relations, relation_errors
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from tests.benchmarks.harness import BenchmarkRow

ALONE = True

POSES = 7_000
RELATIONS = 100_000


def rows() -> Iterator[BenchmarkRow]:
    """Both programs start from trajectories in memory and compute the same measures."""
    truth, estimate = random_walk(0), random_walk(1)
    ours = fastest(lambda: evaluate(Result(estimate), Truth(truth), EvaluationOptions(align="se2")))
    evos = fastest(lambda: evo_measures(truth, estimate), repeats=1)
    yield BenchmarkRow("evaluation.trajectory_over_evo", ours / evos, "", bound=0.1)
    yield BenchmarkRow(
        "evaluation.relations", fastest(lambda: relation_errors(estimate, relations())), "s", bound=0.5
    )
    yield BenchmarkRow(
        "evaluation.walls", fastest(lambda: wall_distances(*maps(), np.zeros(3)), 1), "s", bound=5.0
    )


def fastest(measure: Callable[[], object], repeats: int = 3) -> float:
    """The smallest wall time of several runs."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        measure()
        times.append(time.perf_counter() - started)
    return min(times)


def random_walk(noise_seed: int) -> Trajectory:
    """A random walk with the noise of a seed."""
    steps = np.random.default_rng(7).normal(0.0, 0.1, (POSES, 3))
    noise = np.random.default_rng(noise_seed).normal(0.0, 0.01, (POSES, 3))
    return Trajectory(np.arange(POSES, dtype=np.int64) * 100_000_000, np.cumsum(steps, axis=0) + noise)


def evo_measures(truth: Trajectory, estimate: Trajectory) -> None:
    """The same measures by evo: association, alignment, APE and RPE, translation and rotation."""
    pair = sync.associate_trajectories(_as_evo(truth), _as_evo(estimate))
    pair[1].align(pair[0])
    for relation in (PoseRelation.translation_part, PoseRelation.rotation_angle_deg):
        for metric in (metrics.APE(relation), metrics.RPE(relation)):
            metric.process_data(pair)
            metric.get_all_statistics()


def _as_evo(path: Trajectory) -> PoseTrajectory3D:
    xyz = np.column_stack([path.poses[:, :2], np.zeros(len(path))])
    return PoseTrajectory3D(xyz, quaternion_of_yaw(path.poses[:, 2]), path.stamps_ns / 1e9)


def relations() -> Relations:
    """Relations between random times of the walk."""
    ends = np.random.default_rng(2).integers(0, POSES * 100_000_000, (RELATIONS, 2))
    return Relations(ends[:, 0], ends[:, 1], np.zeros((RELATIONS, 3)))


def maps() -> tuple[OccupancyGrid, OccupancyGrid]:
    """A map of 100 m x 100 m with cells of 5 cm, 2 % of which are walls."""
    rng = np.random.default_rng(3)
    geometry = GridGeometry(0.05, (0.0, 0.0))
    first, second = (
        OccupancyGrid((rng.random((2000, 2000)) < 0.02).astype(np.float32), geometry) for _ in "ab"
    )
    return first, second
