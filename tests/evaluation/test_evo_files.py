"""Files of six-dimensional motion through evo's readers, projected to the plane, and through ours: the same figures.

The files are made by seed, in the manner of evo's own test data: a hand-held camera with a reference at 100 Hz and an estimate of
key frames, and a car in KITTI's format.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.metrics import PoseRelation, Unit
from evo.core.trajectory import Plane
from evo.tools import file_interface
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gridslam.evaluation.document import evaluate
from gridslam.evaluation.inputs import EvaluationOptions
from gridslam.evaluation.readers.from_files import load_result, load_truth

Floats = NDArray[np.float64]
NAMES = ("rmse", "mean", "median", "std", "min", "max")


def motion(seed: int, count: int) -> tuple[Floats, Floats, Floats]:
    """Stamps, positions `(n, 3)` and rotation vectors `(n, 3)` of a smooth path that leaves the plane and tilts."""
    rng = np.random.default_rng(seed)
    times = 1_305_031_098.0 + np.round(np.cumsum(rng.uniform(0.005, 0.015, count)), 4)
    xyz = np.cumsum(np.cumsum(rng.normal(0.0, 2e-4, (count, 3)), axis=0), axis=0)
    angles = np.cumsum(rng.normal(0.0, 0.01, (count, 3)), axis=0) * [0.2, 0.2, 1.0]
    return times, xyz, angles


def write_tum(path: Path, times: Floats, xyz: Floats, angles: Floats) -> Path:
    quaternions = Rotation.from_euler("xyz", angles).as_quat()
    rows = np.column_stack([times, xyz, quaternions])
    np.savetxt(path, rows, fmt=["%.4f", *["%.9f"] * 7])
    return path


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("align", ["none", "origin"])
def test_tum_files_of_six_dimensional_motion(tmp_path: Path, seed: int, align: str) -> None:
    rng = np.random.default_rng(100 + seed)
    times, xyz, angles = motion(seed, 1200)
    truth = write_tum(tmp_path / "truth.tum", times, xyz, angles)
    keys = np.sort(rng.choice(1200, 150, replace=False))
    noisy = xyz[keys] + rng.normal(0.0, 0.02, (150, 3)), angles[keys] + rng.normal(0.0, 0.01, (150, 3))
    estimate = write_tum(tmp_path / "estimate.tum", times[keys] + 0.001, *noisy)
    true = load_truth(truth)
    ours = evaluate(load_result(estimate, true), true, EvaluationOptions(align=align))
    reference = file_interface.read_tum_trajectory_file(truth)
    other = file_interface.read_tum_trajectory_file(estimate)
    for trajectory in (reference, other):
        trajectory.project(Plane.XY)
    pair = sync.associate_trajectories(reference, other)
    if align == "origin":
        pair[1].align_origin(pair[0])
    for ours_name, relation in (
        ("trans", PoseRelation.translation_part),
        ("rot", PoseRelation.rotation_angle_deg),
    ):
        for kind, metric in (
            ("ape", metrics.APE(relation)),
            ("rpe", metrics.RPE(relation, 1, Unit.frames)),
        ):
            metric.process_data(pair)
            found, expected = ours[kind][ours_name], metric.get_all_statistics()
            for name in NAMES:
                assert found[name] == pytest.approx(expected[name], abs=1e-9), (kind, ours_name, name)
