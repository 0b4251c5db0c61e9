from __future__ import annotations

import numpy as np
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D

from gridslam.core import poses as se2
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.report.errors_over_time import errors_over_time


def two_paths() -> tuple[Trajectory, Trajectory]:
    """A truth, and a noisy estimate of it in another frame."""
    rng = np.random.default_rng(3)
    stamps = np.arange(100, dtype=np.int64) * 100_000_000
    yaw = np.linspace(0, 5, 100)
    truth = np.column_stack([3 * np.cos(yaw), 2 * np.sin(yaw), se2.wrap_angle(yaw)])
    noisy = truth + rng.normal(0, [0.05, 0.05, 0.02], (100, 3))
    return Trajectory(stamps, se2.compose([4.0, -1.0, 0.7], noisy)), Trajectory(stamps, truth)


def as_evo(path: Trajectory) -> PoseTrajectory3D:
    positions = np.column_stack([path.poses[:, :2], np.zeros(len(path))])
    return PoseTrajectory3D(positions, quaternion_of_yaw(path.poses[:, 2]), path.stamps_ns / 1e9)


def test_aligned_errors_are_those_of_evo() -> None:
    estimate, truth = two_paths()
    errors = errors_over_time(estimate, truth, "se2")
    assert errors is not None
    reference, aligned = sync.associate_trajectories(as_evo(truth), as_evo(estimate))
    aligned.align(reference)
    for relation, found in (
        (metrics.PoseRelation.translation_part, errors.ape.translation_m),
        (metrics.PoseRelation.rotation_angle_deg, errors.ape.rotation_deg),
    ):
        ape = metrics.APE(relation)
        ape.process_data((reference, aligned))
        assert np.abs(ape.error - found).max() < 1e-6


def test_errors_of_a_localization_are_taken_as_they_are() -> None:
    estimate, truth = two_paths()
    errors = errors_over_time(estimate, truth, "none")
    assert errors is not None
    apart = estimate.poses[:, :2] - truth.poses[:, :2]
    assert np.allclose(errors.ape.translation_m, np.hypot(apart[:, 0], apart[:, 1]))


def test_what_alignment_leaves_of_a_localizations_error_is_given_if_it_is_little() -> None:
    estimate, truth = two_paths()
    for path, is_given in ((estimate, True), (truth, False)):
        errors = errors_over_time(path, truth, "none")
        assert errors is not None
        assert (errors.aligned_rmse_m is not None) is is_given
    noise = np.random.default_rng(1).normal(0.0, 1.0, truth.poses.shape)
    wrong = errors_over_time(Trajectory(truth.stamps_ns, truth.poses + noise), truth, "none")
    assert wrong is not None
    assert wrong.aligned_rmse_m is None


def test_a_truth_of_another_time_gives_no_errors() -> None:
    estimate, truth = two_paths()
    assert errors_over_time(estimate, Trajectory(truth.stamps_ns + 10**12, truth.poses), "se2") is None
    assert errors_over_time(Trajectory.empty(), truth, "se2") is None
