"""Rigid transforms in space as (translation, quaternion) of plain floats, for extrinsics."""

from __future__ import annotations

import math
from typing import TypeAlias

from gridslam.core.messages import canonical_yaw

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]  # w, x, y, z
Rigid: TypeAlias = tuple[Vector, Quaternion]

MAX_NORM_ERROR = 0.1  # largest error of a rotation's norm: beyond it the numbers are something else
JOINT_NOISE_M, JOINT_NOISE_RAD = 1e-4, 1e-3
IDENTITY: Rigid = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b followed by a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """The vector turned by the unit quaternion."""
    _, x, y, z = multiply(multiply(q, (0.0, *v)), (q[0], -q[1], -q[2], -q[3]))
    return x, y, z


def normalise(q: Quaternion) -> Quaternion | None:
    """The unit quaternion, or None if it has no direction."""
    norm = math.sqrt(sum(c * c for c in q))
    if not math.isfinite(norm) or norm < 1e-6:
        return None
    # Keep the digits of a unit quaternion: a round trip through a file keeps them too.
    if abs(norm - 1.0) < 1e-12:
        return q
    return (q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)


def is_same(a: Rigid, b: Rigid) -> bool:
    """Whether two poses differ by no more than the noise of a joint that does not move."""
    moved_m = max(abs(p - q) for p, q in zip(a[0], b[0], strict=True))
    # |cos| of half the angle between; 1 - cos(h) is h^2 / 2.
    half_cos = abs(sum(p * q for p, q in zip(a[1], b[1], strict=True)))
    return moved_m <= JOINT_NOISE_M and 1.0 - half_cos <= JOINT_NOISE_RAD**2 / 8.0 + 1e-15


def compose(T_a_b: Rigid, T_b_c: Rigid) -> Rigid:
    """T_a_c. An identity on either side leaves the other's digits untouched."""
    if T_a_b == IDENTITY:
        return T_b_c
    if T_b_c == IDENTITY:
        return T_a_b
    x, y, z = rotate(T_a_b[1], T_b_c[0])
    tx, ty, tz = T_a_b[0]
    return (tx + x, ty + y, tz + z), multiply(T_a_b[1], T_b_c[1])


def inverse(T_a_b: Rigid) -> Rigid:
    """T_b_a."""
    w, x, y, z = T_a_b[1]
    back: Quaternion = (w, -x, -y, -z)
    tx, ty, tz = rotate(back, T_a_b[0])
    return (-tx, -ty, -tz), back


def from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Roll about x, then pitch about y, then yaw about z, axes fixed (the convention of URDF and tf)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def yaw_of(q: Quaternion) -> float:
    """Heading of the turned x axis, in (-pi, pi]."""
    w, x, y, z = q
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def heading_of(q: Quaternion) -> float:
    """Canonical yaw of a rotation; NaN where the numbers are none, as those of a message that was never filled."""
    norm = math.sqrt(sum(c * c for c in q))
    return canonical_yaw(yaw_of(q)) if abs(norm - 1.0) <= MAX_NORM_ERROR else math.nan
