"""Rigid motions of the plane: against homogeneous matrices, and their conventions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

numbers = st.floats(-50.0, 50.0)
angles = st.floats(-20.0, 20.0)
poses = st.builds(lambda x, y, yaw: np.array([x, y, yaw]), numbers, numbers, angles)


def matrix_of(pose: Floats) -> Floats:
    """Homogeneous matrix `(3, 3)` of a pose (3,)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


@given(angles)
def test_wrapped_angles_lie_in_the_half_open_interval_and_keep_their_direction(angle: float) -> None:
    wrapped = float(se2.wrap_angle(angle))
    assert -np.pi < wrapped <= np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-12)


def test_pi_is_kept_and_minus_pi_becomes_pi() -> None:
    np.testing.assert_array_equal(se2.wrap_angle([np.pi, -np.pi, 0.0]), [np.pi, np.pi, 0.0])


@given(poses, poses)
def test_composition_is_the_product_of_homogeneous_matrices(a: Floats, b: Floats) -> None:
    np.testing.assert_allclose(matrix_of(se2.compose(a, b)), matrix_of(a) @ matrix_of(b), atol=1e-10)


@given(poses)
def test_a_pose_and_its_inverse_compose_to_the_identity(pose: Floats) -> None:
    for product in (se2.compose(pose, se2.inverse(pose)), se2.compose(se2.inverse(pose), pose)):
        np.testing.assert_allclose(product, 0.0, atol=1e-11)


@given(poses, poses)
def test_between_is_the_second_pose_in_the_frame_of_the_first(a: Floats, b: Floats) -> None:
    np.testing.assert_allclose(matrix_of(se2.compose(a, se2.between(a, b))), matrix_of(b), atol=1e-10)


def test_many_poses_broadcast_and_equal_single_ones() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(0.0, 2.0, (4, 1, 3)), rng.normal(0.0, 2.0, (5, 3))
    many = se2.compose(a, b)
    assert many.shape == (4, 5, 3)
    single = [[se2.compose(a[i, 0], b[k]) for k in range(5)] for i in range(4)]
    np.testing.assert_allclose(many, single, atol=1e-14)
    np.testing.assert_allclose(se2.inverse(b), [se2.inverse(pose) for pose in b], atol=1e-14)


@given(poses)
def test_points_are_transformed_as_by_the_homogeneous_matrix(pose: Floats) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [-2.0, 3.0]])
    expected = (matrix_of(pose) @ np.column_stack([points, np.ones(3)]).T).T[:, :2]
    np.testing.assert_allclose(se2.transform_points(pose, points), expected, atol=1e-12)


def test_yaw_is_interpolated_across_pi() -> None:
    halfway = se2.interpolate([0.0, 0.0, 3.0], [1.0, 2.0, -3.0], 0.5)
    np.testing.assert_allclose(halfway, [0.5, 1.0, np.pi], atol=1e-12)


@given(angles)
def test_quaternions_of_yaws_are_unit_and_give_them_back(yaw: float) -> None:
    quaternion = se2.quaternion_of_yaw(yaw)
    assert float(np.linalg.norm(quaternion)) == pytest.approx(1.0)
    assert np.exp(1j * float(se2.yaw_of_quaternion(quaternion))) == pytest.approx(np.exp(1j * yaw), abs=1e-12)


def test_a_rotated_covariance_is_that_of_rotated_samples() -> None:
    rng = np.random.default_rng(1)
    root, yaw = rng.normal(0.0, 1.0, (3, 3)), 0.7
    samples = rng.standard_normal((1000, 3)) @ root.T
    rotated = samples.copy()
    rotated[:, :2] = se2.transform_points([0.0, 0.0, yaw], samples[:, :2])
    np.testing.assert_allclose(se2.rotate_covariance(np.cov(samples.T), yaw), np.cov(rotated.T), atol=1e-12)


def test_compounded_covariances_are_those_of_composed_samples() -> None:
    rng = np.random.default_rng(2)
    pose, step = np.array([3.0, -1.0, 0.8]), np.array([2.0, 0.5, -0.4])
    covariance, step_covariance = np.diag([0.02, 0.01, 0.003]) ** 2, np.diag([0.01, 0.03, 0.002]) ** 2
    covariance[0, 2] = covariance[2, 0] = 3e-5
    poses = pose + rng.multivariate_normal(np.zeros(3), covariance, 200_000)
    steps = step + rng.multivariate_normal(np.zeros(3), step_covariance, 200_000)
    mean, found = se2.compound(pose, covariance, step, step_covariance)
    np.testing.assert_allclose(mean, se2.compose(pose, step))
    np.testing.assert_allclose(found, np.cov(se2.compose(poses, steps).T), atol=6e-6)


@given(poses, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_an_error_of_the_yaw_turns_what_follows(pose: Floats, x: float, y: float) -> None:
    step, small = np.array([x, y, 0.3]), 1e-6
    turned = se2.compose(pose + np.array([0.0, 0.0, small]), step) - se2.compose(pose, step)
    displacement = se2.compose(pose, step)[:2] - pose[:2]
    np.testing.assert_allclose(turned[:2] / small, se2.turning_jacobian(displacement)[:2, 2], atol=1e-4)
