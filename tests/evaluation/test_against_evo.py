"""APE and RPE equal evo's on random planar trajectories."""

from __future__ import annotations

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.metrics import PoseRelation, Unit
from evo.core.sync_method import SyncMethod
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridslam.core.poses import quaternion_of_yaw, wrap_angle
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.association import Pairs, associate
from gridslam.evaluation.pose_errors import Delta, absolute_errors, relative_errors
from gridslam.evaluation.statistics import NAMES, statistics

UNITS = {"frames": Unit.frames, "metres": Unit.meters}
EVO_SYNC = {"nearest": SyncMethod.nearest_time, "interpolate": SyncMethod.interpolation}
few = settings(max_examples=30, deadline=None)


def as_evo(trajectory: Trajectory) -> PoseTrajectory3D:
    xyz = np.column_stack([trajectory.poses[:, :2], np.zeros(len(trajectory))])
    quaternions = quaternion_of_yaw(trajectory.poses[:, 2])
    return PoseTrajectory3D(xyz, quaternions, trajectory.stamps_ns / 1e9)


def random_pair(seed: int) -> tuple[Trajectory, Trajectory]:
    """A truth with uneven stamps, and an estimate of it in another frame, noisy, with stamps a little off.

    Stamps are whole milliseconds plus 0.1 ms, so that none lies exactly on the bound of the association.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8, 80))
    stamps = np.cumsum(rng.integers(3, 40, n)) * 1_000_000
    yaw = np.cumsum(rng.normal(0.0, 0.3, n))
    step = rng.uniform(0.0, 0.4, n) * (rng.random(n) > 0.2)
    xy = np.cumsum(np.column_stack([step * np.cos(yaw), step * np.sin(yaw)]), axis=0)
    truth = Trajectory(stamps, np.column_stack([xy, wrap_angle(yaw)]))
    keep = np.flatnonzero(rng.random(n) < rng.uniform(0.4, 1.0))
    shift = rng.integers(-14, 15, len(keep)) * 1_000_000 + 100_000
    yaw_offset = rng.uniform(-np.pi, np.pi)
    moved = xy[keep] @ np.array(
        [[np.cos(yaw_offset), np.sin(yaw_offset)], [-np.sin(yaw_offset), np.cos(yaw_offset)]]
    )
    noisy = moved + rng.uniform(-9, 9, 2) + rng.normal(0, 0.03, moved.shape)
    heading = wrap_angle(yaw[keep] + yaw_offset + rng.normal(0, 0.05, len(keep)))
    estimate = Trajectory(stamps[keep] + shift, np.column_stack([noisy, heading])).sorted()
    if rng.random() < 0.3:
        truth, estimate = estimate, truth
    return estimate, truth


def both_sides(seed: int, kind: str) -> tuple[Pairs, PoseTrajectory3D, PoseTrajectory3D]:
    estimate, truth = random_pair(seed)
    pairs = associate(estimate, truth, kind, max_difference_ns=10_000_000)
    assume(len(pairs) >= 5)
    evo_truth, evo_estimate = sync.associate_trajectories(
        as_evo(truth), as_evo(estimate), sync_method=EVO_SYNC[kind], max_diff=0.01
    )
    return pairs, evo_truth, evo_estimate


def evo_statistics(metric: metrics.PE, truth: PoseTrajectory3D, estimate: PoseTrajectory3D) -> list[float]:
    metric.process_data((truth, estimate))
    return [metric.get_all_statistics()[name] for name in NAMES]


def ours(values: NDArray[np.float64]) -> list[float]:
    return [statistics(values)[name] for name in NAMES]


def near(expected: list[float]) -> object:
    return pytest.approx(expected, rel=1e-9, abs=1e-9)


@few
@given(st.integers(0, 10**6), st.sampled_from(["nearest", "interpolate"]))
def test_the_same_poses_are_paired(seed: int, kind: str) -> None:
    pairs, evo_truth, evo_estimate = both_sides(seed, kind)
    assert len(pairs) == evo_truth.num_poses
    assert np.allclose(pairs.truth[:, :2], evo_truth.positions_xyz[:, :2], atol=1e-9)
    assert np.allclose(pairs.estimate[:, :2], evo_estimate.positions_xyz[:, :2], atol=1e-9)


@few
@given(
    st.integers(0, 10**6),
    st.sampled_from(["none", "origin", "se2"]),
    st.booleans(),
    st.sampled_from(["nearest", "interpolate"]),
)
def test_absolute_errors(seed: int, align: str, with_scale: bool, kind: str) -> None:
    pairs, evo_truth, evo_estimate = both_sides(seed, kind)
    alignment = find_alignment(pairs.estimate, pairs.truth, align, with_scale)
    assert alignment is not None
    if align == "se2":
        singular = np.linalg.svd(np.cov(evo_estimate.positions_xyz[:, :2].T))[1]
        assume(singular.min() > 1e-6)  # evo fits in space and refuses a straight line
        R_truth_estimate, _, _ = evo_estimate.align(evo_truth, correct_scale=with_scale)
        assume(R_truth_estimate[2, 2] > 0.0)  # evo turned the plane over: see the test below
    elif align == "origin":
        evo_estimate.align_origin(evo_truth)
    errors = absolute_errors(alignment.apply(pairs.estimate), pairs.truth)
    translation = metrics.APE(PoseRelation.translation_part)
    rotation = metrics.APE(PoseRelation.rotation_angle_deg)
    assert ours(errors.translation_m) == near(evo_statistics(translation, evo_truth, evo_estimate))
    assert ours(errors.rotation_deg) == near(evo_statistics(rotation, evo_truth, evo_estimate))


@pytest.mark.parametrize("with_scale", [False, True])
def test_where_evo_turns_the_plane_over_the_fit_remains_in_the_plane(with_scale: bool) -> None:
    """A path and its mirror image: evo flips it in space and finds no error at all.

    In the plane, of points s = (x, y) about their mean and t = (x, -y), the sums of the fit are sum(x^2 - y^2) for
    the cosine and -2 sum(x y) for the sine. For this path they are 6 - 2 = 4 and 0: no turn, and the scale is
    4 / (6 + 2) = 1/2 where it is free; each pose stays |t - scale s| off.
    """
    xy = np.array([[-1.0, -1.0], [-1.0, 1.0], [2.0, 0.0]])
    stamps = np.arange(len(xy)) * 1_000_000_000
    estimate = Trajectory(stamps, np.column_stack([xy, np.zeros(len(xy))]))
    truth = Trajectory(stamps, estimate.poses * [1.0, -1.0, 1.0])
    pairs = associate(estimate, truth, "nearest")
    mirrored = as_evo(estimate)
    R_truth_estimate, _, _ = mirrored.align(as_evo(truth), correct_scale=with_scale)
    assert R_truth_estimate[2, 2] == pytest.approx(-1.0)
    assert np.allclose(mirrored.positions_xyz[:, :2], truth.poses[:, :2], atol=1e-9)
    alignment = find_alignment(pairs.estimate, pairs.truth, "se2", with_scale)
    assert alignment is not None
    scale = 0.5 if with_scale else 1.0
    assert alignment.scale == pytest.approx(scale)
    assert np.allclose(alignment.T_truth_estimate, 0.0, atol=1e-12)
    errors = absolute_errors(alignment.apply(pairs.estimate), pairs.truth)
    assert errors.translation_m == pytest.approx(np.hypot(*(truth.poses - scale * estimate.poses)[:, :2].T))


@few
@given(
    st.integers(0, 10**6),
    st.sampled_from([(1.0, "frames"), (4.0, "frames"), (0.5, "metres"), (1.3, "metres")]),
    st.booleans(),
)
def test_relative_errors(seed: int, delta: tuple[float, str], all_pairs: bool) -> None:
    pairs, evo_truth, evo_estimate = both_sides(seed, "nearest")
    size, unit = delta
    errors = relative_errors(pairs, Delta(size, unit, all_pairs))
    assume(len(errors.translation_m))
    for relation, values in (
        (PoseRelation.translation_part, errors.translation_m),
        (PoseRelation.rotation_angle_deg, errors.rotation_deg),
    ):
        metric = metrics.RPE(relation, size, UNITS[unit], all_pairs=all_pairs)
        assert ours(values) == near(evo_statistics(metric, evo_truth, evo_estimate))
