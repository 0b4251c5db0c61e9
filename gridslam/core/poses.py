"""Rigid motions of the plane as arrays `(..., 3)` of x (m), y (m), yaw (rad, counter-clockwise).

A transform `T_a_b` maps points of frame b into frame a and reads "b expressed in a"; `compose(T_a_b, T_b_c)` is
`T_a_c`. All functions broadcast over leading axes and return float64.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MAX_COORDINATE_M = 1e9  # larger coordinates lose centimetre accuracy in double arithmetic


def wrap_angle(angle_rad: ArrayLike) -> Array:
    """Angles wrapped to (-pi, pi], same shape."""
    if isinstance(angle_rad, float):
        return np.asarray(_wrap_one(angle_rad))
    angle = np.asarray(angle_rad, dtype=np.float64)
    wrapped = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    inside = (angle > -np.pi) & (angle <= np.pi)
    return np.where(inside, angle, wrapped)


def _wrap_one(angle: float) -> float:
    """`wrap_angle` of one number."""
    return angle if -math.pi < angle <= math.pi else math.pi - (math.pi - angle) % (2.0 * math.pi)


def _compose_one(a: Sequence[float], b: Sequence[float]) -> Array:
    """`compose` of two single poses, ten times as fast with floats as with arrays."""
    (ax, ay, a_yaw), (bx, by, b_yaw) = a, b
    cos, sin = math.cos(a_yaw), math.sin(a_yaw)
    yaw = a_yaw + b_yaw
    if not -math.pi < yaw <= math.pi:
        yaw = _wrap_one(yaw)
    return np.array((ax + cos * bx - sin * by, ay + sin * bx + cos * by, yaw))


def _inverse_one(a: Sequence[float]) -> tuple[float, float, float]:
    """`inverse` of one pose."""
    x, y, yaw = a
    cos, sin = math.cos(yaw), math.sin(yaw)
    return -cos * x - sin * y, sin * x - cos * y, _wrap_one(-yaw)


def _interpolate_one(a: Sequence[float], b: Sequence[float], t: float) -> Array:
    """`interpolate` of two single poses."""
    (ax, ay, a_yaw), (bx, by, b_yaw) = a, b
    yaw = _wrap_one(a_yaw + t * _wrap_one(b_yaw - a_yaw))
    return np.array((ax + t * (bx - ax), ay + t * (by - ay), yaw))


def compose(T_a_b: ArrayLike, T_b_c: ArrayLike) -> Array:
    """T_a_c, shape the broadcast of both inputs, yaw wrapped."""
    a = np.asarray(T_a_b, dtype=np.float64)
    b = np.asarray(T_b_c, dtype=np.float64)
    if a.ndim == 1 and b.ndim == 1:
        return _compose_one(a.tolist(), b.tolist())
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = a[..., 0] + cos * b[..., 0] - sin * b[..., 1]
    y = a[..., 1] + sin * b[..., 0] + cos * b[..., 1]
    return np.stack(np.broadcast_arrays(x, y, wrap_angle(a[..., 2] + b[..., 2])), axis=-1)


def inverse(T_a_b: ArrayLike) -> Array:
    """T_b_a, the inverse of T_a_b `(..., 3)`."""
    a = np.asarray(T_a_b, dtype=np.float64)
    if a.ndim == 1:
        return np.array(_inverse_one(a.tolist()))
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    x = -cos * a[..., 0] - sin * a[..., 1]
    y = sin * a[..., 0] - cos * a[..., 1]
    return np.stack([x, y, wrap_angle(-a[..., 2])], axis=-1)


def between(T_m_a: ArrayLike, T_m_b: ArrayLike) -> Array:
    """T_a_b `(..., 3)`: pose b in the frame of pose a, given both `(..., 3)` in a frame m."""
    a = np.asarray(T_m_a, np.float64)
    b = np.asarray(T_m_b, np.float64)
    if a.ndim == 1 and b.ndim == 1:
        return _compose_one(_inverse_one(a.tolist()), b.tolist())
    return compose(inverse(a), b)


def transform_points(T_a_b: ArrayLike, points_b: ArrayLike) -> Array:
    """Points `(n, 2)` of frame b expressed in frame a; `T_a_b` is one pose `(3,)`."""
    pose = np.asarray(T_a_b, dtype=np.float64)
    points = np.asarray(points_b, dtype=np.float64)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    rotation = np.array([[cos, -sin], [sin, cos]])
    return np.asarray(points @ rotation.T + pose[:2])


def interpolate(pose_0: ArrayLike, pose_1: ArrayLike, fraction: ArrayLike) -> Array:
    """Poses `(..., 3)` at `fraction` (0 to 1) between two poses: on the straight line, yaw along the shorter rotation."""
    a = np.asarray(pose_0, dtype=np.float64)
    b = np.asarray(pose_1, dtype=np.float64)
    if a.ndim == 1 and b.ndim == 1 and isinstance(fraction, float):
        return _interpolate_one(a.tolist(), b.tolist(), fraction)
    t = np.asarray(fraction, dtype=np.float64)
    x = a[..., 0] + t * (b[..., 0] - a[..., 0])
    y = a[..., 1] + t * (b[..., 1] - a[..., 1])
    yaw = wrap_angle(a[..., 2] + t * wrap_angle(b[..., 2] - a[..., 2]))
    return np.stack(np.broadcast_arrays(x, y, yaw), axis=-1)


def yaw_of_quaternion(quat_wxyz: ArrayLike) -> Array:
    """Yaw of quaternions `(..., 4)`, in (-pi, pi]."""
    q = np.asarray(quat_wxyz, dtype=np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return wrap_angle(np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))


def quaternion_of_yaw(yaw_rad: ArrayLike) -> Array:
    """Unit quaternions (w, x, y, z) `(..., 4)` of rotations about the vertical."""
    half = 0.5 * np.asarray(yaw_rad, dtype=np.float64)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def turning_jacobian(displacement: ArrayLike) -> Array:
    """Derivative `(..., 3, 3)` of a pose with respect to an earlier pose, both in the map frame, for a fixed motion between them.

    `displacement` `(..., 2)` (x, y) is the later position minus the earlier one; an error of the earlier yaw rotates it.
    """
    moved = np.asarray(displacement, dtype=np.float64)
    jacobian = np.zeros((*moved.shape[:-1], 3, 3))
    jacobian[..., [0, 1, 2], [0, 1, 2]] = 1.0
    jacobian[..., 0, 2], jacobian[..., 1, 2] = -moved[..., 1], moved[..., 0]
    return jacobian


def compound(
    T_m_a: ArrayLike, covariance: ArrayLike, T_a_b: ArrayLike, step_covariance: ArrayLike
) -> tuple[Array, Array]:
    """The pose T_m_b `(3,)` and its covariance `(3, 3)` after an uncertain step in the frame of an uncertain pose.

    Smith, Self, Cheeseman 1990. The covariances are over x, y, yaw: of T_m_a in the axes of m, of the step in those of a.
    """
    yaw = float(np.asarray(T_m_a, dtype=np.float64)[2])
    jacobian = turning_jacobian(compose([0.0, 0.0, yaw], T_a_b)[:2])
    propagated = jacobian @ np.asarray(covariance, dtype=np.float64) @ jacobian.T
    return compose(T_m_a, T_a_b), propagated + rotate_covariance(step_covariance, yaw)


def rotate_covariance(covariance: ArrayLike, yaw_rad: ArrayLike) -> Array:
    """Covariances over x, y, yaw `(..., 3, 3)` in axes rotated by `yaw_rad` `(...)`: R C R'."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    rotation = np.zeros((*np.shape(yaw_rad), 3, 3))
    rotation[..., 0, 0], rotation[..., 0, 1], rotation[..., 1, 0], rotation[..., 1, 1] = c, -s, s, c
    rotation[..., 2, 2] = 1.0
    return np.asarray(rotation @ np.asarray(covariance, dtype=np.float64) @ rotation.swapaxes(-1, -2))
