"""Checks whether a cloud sensor sees the floor where its extrinsics put it. If it hangs upside down or is tilted, it does not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import PointCloud
from gridslam.logs.checks.scan_units import CloudUnits
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.placement.virtual_scan import (
    GROUND_M,
    HALF_BAND_M,
    HEAD_M,
    RAISED_M,
    VirtualLidar,
)
from gridslam.logs.streams import Source, first_items

Floats = NDArray[np.float64]

PEEKED_CLOUDS, EVERY_CLOUD = 20, 4  # every fourth of the first 20 clouds is examined, since clouds are large
MAX_POINTS, TRIALS = 4000, 400  # largest number of points examined, and number of planes tried
PLANE_M = 0.04  # half thickness of a floor: noise of ranges, unevenness
MAX_BELOW = 0.01  # fraction of the points that may lie below the floor: reflections
MIN_CONTRAST = 2.0  # smallest ratio of the points of a floor to those within as much height above it
MIN_FRACTION = 0.05  # smallest fraction of points on the floor, for a sensor that sees it at all
MAX_MISSING = 0.3  # largest number of points where the extrinsics put the floor, relative to the points of the floor found
MAX_HEIGHT_ERROR = 0.15  # largest relative error of the height above the floor
MAX_TILT_RAD = math.radians(30.0)  # largest tilt of a sensor that looks around
# Smallest tilt that is a fault: less may be the floor's, and the height band allows it
MIN_TILT_RAD = math.radians(2.0)
MIN_WIDTH_RATIO = 0.3  # smallest ratio of the extents of a floor: the foot of a wall is a line


def lidars_on_the_floor(
    source: Source,
    kind_of: Mapping[int, str],
    lidars: Mapping[str, VirtualLidar],
    message_counts: MessageCounts,
) -> Mapping[str, VirtualLidar]:
    """The lidars made of clouds, by frame; on a level robot those whose first clouds show the floor elsewhere are turned."""
    found = dict(lidars)
    for index, kind in kind_of.items():
        frame = next(iter(source.streams[index].frames), "")
        if kind != "scan" or source.streams[index].kind != "cloud" or frame not in lidars:
            continue
        if lidars[frame].tilt is None:
            in_metres = CloudUnits("", MessageCounts()).repaired
            first = first_items(source, index, PEEKED_CLOUDS)[::EVERY_CLOUD]
            clouds = [in_metres(event) for event in first if isinstance(event, PointCloud)]
            found[frame] = placed_by_floor(lidars[frame], clouds, message_counts)
    return found


def placed_by_floor(lidar: VirtualLidar, clouds: Iterable[PointCloud], counts: MessageCounts) -> VirtualLidar:
    """The lidar with the rotation that puts the floor below it; the same object if the floor is there already, or not seen."""
    height_m = float(lidar.translation_m[2])
    points = _sample([cloud.points_m for cloud in clouds])
    if len(points) < MAX_POINTS // 4:
        return lidar
    given = points @ lidar.rotation.T
    if height_m < RAISED_M:
        return _above_the_floor(lidar, given + np.array([0.0, 0.0, height_m]), counts)
    at_floor = float((np.abs(given[:, 2] + height_m) < PLANE_M).mean())
    up, fraction = _floor(given, height_m)
    if fraction < MIN_FRACTION or at_floor > MAX_MISSING * fraction:
        return lidar
    is_upside_down = bool(up[2] < 0.0)
    tilt_rad = math.acos(min(abs(float(up[2])), 1.0))
    if not is_upside_down and tilt_rad < MIN_TILT_RAD:
        return lidar
    turned_over = np.diag([1.0, -1.0, -1.0]) if is_upside_down else np.eye(3)
    level = _level(turned_over @ up)
    what = ["hangs upside down"] * is_upside_down
    what += [f"is tilted by {math.degrees(tilt_rad):.0f} deg"] * (tilt_rad >= MIN_TILT_RAD)
    frame = lidar.frame_id.removesuffix("_planar")
    counts.find(
        f"{frame} {' and '.join(what)} by the floor that it sees, but not by its extrinsics: its clouds are rotated; "
        f"set log.extrinsics.{frame} with roll and pitch"
    )
    return replace(lidar, rotation=level @ turned_over @ lidar.rotation)


def _above_the_floor(lidar: VirtualLidar, points: Floats, counts: MessageCounts) -> VirtualLidar:
    """The lidar with a band of heights above the floor that points `(n, 3)` in the base frame show within its usual band.

    So it is with clouds that a driver or a filter gives in the base frame.
    """
    is_usual = math.isclose(lidar.max_height_m - lidar.min_height_m, 2.0 * HALF_BAND_M)
    floor_m = _lowest_level(points)
    if not is_usual or floor_m is None or floor_m + GROUND_M <= lidar.min_height_m:
        return lidar
    found = replace(lidar, min_height_m=floor_m + GROUND_M, max_height_m=floor_m + HEAD_M)
    counts.find(
        f"{lidar.frame_id.removesuffix('_planar')}: its clouds show the floor {floor_m:.2f} m high, so returns from "
        f"{found.min_height_m:.2f} to {found.max_height_m:.2f} m are used; log.cloud sets another band"
    )
    return found


def _lowest_level(points: Floats) -> float | None:
    """The height (m) of the lowest wide and level plane through many of the points `(n, 3)`; None if there is none.

    A floor has points above it (walls), but few right above it. A plane with all points, as of a planar lidar, is not a floor.
    """
    heights = np.sort(points[:, 2])
    above_m = heights - heights[int(MAX_BELOW * len(heights))]
    near = points[np.argsort(points[:, 2], kind="stable")][np.abs(above_m) <= PLANE_M]
    next_to_it = np.count_nonzero((above_m > PLANE_M) & (above_m <= 3.0 * PLANE_M))
    walls = np.count_nonzero(above_m > GROUND_M)
    is_many = len(near) > max(MIN_FRACTION * len(points), MIN_CONTRAST * next_to_it)
    is_floor = is_many and walls > MIN_FRACTION * len(points) and _is_wide(near)
    return float(np.median(near[:, 2])) if is_floor else None


def _sample(clouds: list[NDArray[np.float32]]) -> Floats:
    """At most MAX_POINTS points `(n, 3)`, evenly from all clouds."""
    if not clouds:
        return np.zeros((0, 3))
    points = np.concatenate(clouds).astype(np.float64)
    return points[:: max(len(points) // MAX_POINTS, 1)]


def _floor(points: Floats, height_m: float) -> tuple[Floats, float]:
    """The unit vector `(3,)` away from the floor, in the axes of points `(n, 3)` about a sensor, and their fraction on it.

    Floors are planes about as far from the sensor as it is high, above or below, that are tilted by less than MAX_TILT_RAD.
    """
    rng = np.random.default_rng(0)
    corners = points[rng.integers(0, len(points), (TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0.0] / lengths[lengths > 0.0, None]
    distances = np.einsum("ij,ij->i", normals, corners[lengths > 0.0, 0])
    normals = normals * -np.sign(distances)[:, None]  # towards the sensor
    is_floor = np.abs(np.abs(distances) / height_m - 1.0) < MAX_HEIGHT_ERROR
    is_floor &= np.abs(normals[:, 2]) > math.cos(MAX_TILT_RAD)
    best, fraction = np.array([0.0, 0.0, 1.0]), 0.0
    for normal, distance in zip(normals[is_floor], np.abs(distances[is_floor]), strict=True):
        on = np.abs(points @ normal + distance) < PLANE_M
        if on.mean() > fraction and _is_wide(points[on]):
            best, fraction = normal, float(on.mean())
    return best, fraction


def _is_wide(points: Floats) -> bool:
    """Whether points `(n, 3)` lie all over a floor, rather than along a line."""
    extents = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points[:, :2].T)), 0.0))
    return bool(extents[0] > MIN_WIDTH_RATIO * extents[1])


def _level(up: Floats) -> Floats:
    """The smallest rotation `(3, 3)` that takes a unit vector `(3,)` to the z axis."""
    x, y, z = up.tolist()
    factor = 1.0 / (1.0 + z)
    return np.array(
        [[1.0 - x * x * factor, -x * y * factor, -x], [-x * y * factor, 1.0 - y * y * factor, -y], [x, y, z]]
    )
