"""Points with surface normals from the ranges of one planar scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row

MAX_MISSING_BEAMS = 12  # a surface ends at a wider hole
MIN_RADIUS_M = 0.2
MAX_RADIUS_M = 2.5
RADIUS_IN_SPACINGS = 2.5  # at grazing incidence neighbours on a wall lie metres apart
MAX_FLATNESS = 0.15  # smaller / larger eigenvalue of a patch that still counts as a line
MAX_DEVIATION_M = 0.04  # root mean square distance from that line
MAX_CHORD_SLOPE = 0.12  # sine of the angle between a chord and the surfaces at its ends
MIN_CHORD_NORMALS_COS = 0.9  # cosine of the angle between the normals at the ends of a chord


class Projection(NamedTuple):
    """Projection of a sensor's plane onto the horizontal: (x, y) becomes (x_per_x * x + x_per_y * y, y_per_y * y)."""

    x_per_x: float
    x_per_y: float
    y_per_y: float


LEVEL = Projection(1.0, 0.0, 1.0)


class Sweep(NamedTuple):
    """Beam i points to angle_min_rad + i * angle_increment_rad in the sensor's frame, time_increment_s after the beam before."""

    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    projection: Projection = LEVEL


class RangeLimits(NamedTuple):
    """A reading is used if it lies strictly between the limits (m)."""

    min_m: float
    max_m: float


@compiled
def scan_to_points(
    ranges_m: NDArray[np.float32],
    sweep: Sweep,
    limits: RangeLimits,
    extrinsics: NDArray[np.float64],
    twist: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Endpoints `(m, 2)` of the used readings in the robot's frame at the stamp of the scan, and their beam indices `(m,)`.

    NaN is not used. `extrinsics` is T_base_laser (3,). `twist` is the robot's velocity (vx, vy, wz) (3,), by which the
    robot's motion since the first beam is removed.
    """
    n = ranges_m.shape[0]
    points = np.empty((n, 2))
    beams = np.empty(n, np.int64)
    m = 0
    projection = sweep.projection
    cos_m, sin_m = np.cos(extrinsics[2]), np.sin(extrinsics[2])
    for i in range(n):
        r = float(ranges_m[i])
        if not (r > limits.min_m and r < limits.max_m):
            continue
        angle = sweep.angle_min_rad + i * sweep.angle_increment_rad
        lx, ly = r * np.cos(angle), r * np.sin(angle)
        lx, ly = projection.x_per_x * lx + projection.x_per_y * ly, projection.y_per_y * ly
        x = extrinsics[0] + cos_m * lx - sin_m * ly
        y = extrinsics[1] + sin_m * lx + cos_m * ly
        if sweep.time_increment_s != 0.0:
            dt = i * sweep.time_increment_s
            yaw = twist[2] * dt
            half = 0.5 * yaw
            dx = dt * (twist[0] * np.cos(half) - twist[1] * np.sin(half))
            dy = dt * (twist[0] * np.sin(half) + twist[1] * np.cos(half))
            c, s = np.cos(yaw), np.sin(yaw)
            x, y = dx + c * x - s * y, dy + s * x + c * y
        points[m, 0] = x
        points[m, 1] = y
        beams[m] = i
        m += 1
    return points[:m].copy(), beams[:m].copy()


@compiled
def _patch_normal(points: NDArray[np.float64], lo: int, hi: int) -> tuple[float, float]:
    """Unit normal of the line through points lo..hi (inclusive); (0, 0) if they do not lie on a line."""
    k = hi - lo + 1
    mx = my = 0.0
    for j in range(lo, hi + 1):
        mx += points[j, 0]
        my += points[j, 1]
    mx /= k
    my /= k
    xx = xy = yy = 0.0
    for j in range(lo, hi + 1):
        dx, dy = points[j, 0] - mx, points[j, 1] - my
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
    half_difference = np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    larger = 0.5 * (xx + yy) + half_difference
    smaller = max(0.5 * (xx + yy) - half_difference, 0.0)
    if larger <= 0.0 or smaller > MAX_FLATNESS * larger or smaller > k * MAX_DEVIATION_M**2:
        return 0.0, 0.0
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return -np.sin(along), np.cos(along)


@compiled
def _distance(points: NDArray[np.float64], i: int, j: int) -> float:
    """Distance between points i and j."""
    return float(np.sqrt((points[i, 0] - points[j, 0]) ** 2 + (points[i, 1] - points[j, 1]) ** 2))


@compiled
def surface_normals(
    points: NDArray[np.float64], beams: NDArray[np.int64], viewpoint: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit normals `(m, 2)` that face the viewpoint (2,); zero where the neighbouring points do not lie on a line."""
    m = points.shape[0]
    normals = np.zeros((m, 2))
    for i in range(m):
        spacing = MAX_RADIUS_M
        if i > 0:
            spacing = _distance(points, i, i - 1)
        if i < m - 1:
            spacing = min(spacing, _distance(points, i, i + 1))
        radius = min(max(MIN_RADIUS_M, RADIUS_IN_SPACINGS * spacing), MAX_RADIUS_M)
        lo = i
        while (
            lo > 0 and beams[i] - beams[lo - 1] <= MAX_MISSING_BEAMS and _distance(points, i, lo - 1) < radius
        ):
            lo -= 1
        hi = i
        while (
            hi < m - 1
            and beams[hi + 1] - beams[i] <= MAX_MISSING_BEAMS
            and _distance(points, i, hi + 1) < radius
        ):
            hi += 1
        if hi - lo < 2:
            continue
        nx, ny = _patch_normal(points, lo, hi)
        if nx * (viewpoint[0] - points[i, 0]) + ny * (viewpoint[1] - points[i, 1]) < 0.0:
            nx, ny = -nx, -ny
        normals[i, 0] = nx
        normals[i, 1] = ny
    return normals


@compiled
def thin_out(points: NDArray[np.float64], spacing_m: float, max_points: int) -> NDArray[np.int64]:
    """Indices of points along the scan that are at least `spacing_m` apart, at most `max_points` of them at an even stride."""
    m = points.shape[0]
    kept = np.empty(m, np.int64)
    k = 0
    limit = spacing_m * spacing_m
    for i in range(m):
        if k > 0:
            dx = points[i, 0] - points[kept[k - 1], 0]
            dy = points[i, 1] - points[kept[k - 1], 1]
            if dx * dx + dy * dy < limit:
                continue
        kept[k] = i
        k += 1
    if k <= max_points:
        return kept[:k].copy()
    chosen = np.empty(max_points, np.int64)
    for j in range(max_points):
        chosen[j] = kept[(j * k) // max_points]
    return chosen


@compiled
def surface_chords(
    points: NDArray[np.float64], normals: NDArray[np.float64], max_chord_m: float
) -> NDArray[np.bool_]:
    """Whether points i and i + 1 lie on one flat surface `(m,)`: the chord is perpendicular to the normals at both ends."""
    m = points.shape[0]
    chords = np.zeros(m, np.bool_)
    for i in range(m - 1):
        length = _distance(points, i, i + 1)
        if length <= 0.0 or length > max_chord_m:
            continue
        dx, dy = (points[i + 1, 0] - points[i, 0]) / length, (points[i + 1, 1] - points[i, 1]) / length
        flat = True
        for j in (i, i + 1):
            nx, ny = normals[j, 0], normals[j, 1]
            if (nx == 0.0 and ny == 0.0) or abs(nx * dx + ny * dy) > MAX_CHORD_SLOPE:
                flat = False
        if normals[i, 0] * normals[i + 1, 0] + normals[i, 1] * normals[i + 1, 1] < MIN_CHORD_NORMALS_COS:
            flat = False
        chords[i] = flat
    return chords


@compiled
def fill_chords(
    points: NDArray[np.float64], normals: NDArray[np.float64], chords: NDArray[np.bool_], spacing_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The points with normals, and along each chord additional points at most `spacing_m` apart."""
    m = points.shape[0]
    total = 0
    for i in range(m):
        total += 1
        if chords[i]:
            total += int(_distance(points, i, i + 1) / spacing_m)
    filled = np.empty((total, 2))
    filled_normals = np.empty((total, 2))
    k = 0
    for i in range(m):
        copy_row(filled, k, points[i])
        copy_row(filled_normals, k, normals[i])
        k += 1
        if not chords[i]:
            continue
        extra = int(_distance(points, i, i + 1) / spacing_m)
        for j in range(extra):
            t = (j + 1) / (extra + 1)
            filled[k, 0] = (1.0 - t) * points[i, 0] + t * points[i + 1, 0]
            filled[k, 1] = (1.0 - t) * points[i, 1] + t * points[i + 1, 1]
            nx = (1.0 - t) * normals[i, 0] + t * normals[i + 1, 0]
            ny = (1.0 - t) * normals[i, 1] + t * normals[i + 1, 1]
            scale = 1.0 / np.sqrt(nx * nx + ny * ny)
            filled_normals[k, 0] = nx * scale
            filled_normals[k, 1] = ny * scale
            k += 1
    return filled[:k], filled_normals[:k]
