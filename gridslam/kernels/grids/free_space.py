"""Points seen by one scan in the free space of another: range profiles of scans, and what they say about each other's points.

A profile divides the directions around a lidar into equal sectors, and keeps the nearest and the farthest return of each. Sectors
without a return say nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import run_in_ranges


class Profiles(NamedTuple):
    """Nearest and farthest return (m) of scan i in every sector, float32 `(n, sectors)`; 0 without a return."""

    nearest: NDArray[np.float32]
    farthest: NDArray[np.float32]


class Partners(NamedTuple):
    """The scans that are compared with scan i's points: scan[first[i]:first[i + 1]].

    `is_other` is True for a scan of another passage, False for one of the same passage.
    """

    first: NDArray[np.int64]
    scan: NDArray[np.int64]
    is_other: NDArray[np.bool_]


class Tolerances(NamedTuple):
    """Distance (m) up to which a point lies on a surface, its growth per metre of range, and the largest range (m)."""

    floor_m: float
    per_m: float
    max_range_m: float


class Testimony(NamedTuple):
    """Numbers of scans `(m,)` that saw each point free or on a surface, from other passages and from its own passage."""

    free_by_others: NDArray[np.int16]
    occupied_by_others: NDArray[np.int16]
    free_by_own: NDArray[np.int16]


@compiled
def sector_of(x: float, y: float, sectors: int) -> int:
    """The sector of a direction."""
    return int(np.floor((np.arctan2(y, x) / (2.0 * np.pi) + 1.0) * sectors)) % sectors


@compiled
def scan_profiles(
    returns: NDArray[np.float64], first: NDArray[np.int64], viewpoints: NDArray[np.float64], sectors: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Nearest and farthest return of each scan in each sector, `(n, sectors)` both.

    Scan i owns returns[first[i]:first[i + 1]], in the robot's frame as its viewpoint `(2,)` is.
    """
    n = len(viewpoints)
    nearest, farthest = np.zeros((n, sectors), np.float32), np.zeros((n, sectors), np.float32)
    for i in range(n):
        for k in range(first[i], first[i + 1]):
            x, y = returns[k, 0] - viewpoints[i, 0], returns[k, 1] - viewpoints[i, 1]
            sector, distance = sector_of(x, y, sectors), np.float32(np.hypot(x, y))
            if nearest[i, sector] == 0.0 or distance < nearest[i, sector]:
                nearest[i, sector] = distance
            farthest[i, sector] = max(farthest[i, sector], distance)
    return nearest, farthest


@compiled
def _verdict(
    nearest: NDArray[np.float32], farthest: NDArray[np.float32], x: float, y: float, limits: Tolerances
) -> int:
    """State of a point (x, y) by a profile `(sectors,)` seen from its viewpoint: 1 free, -1 on a surface, 0 unknown."""
    distance = np.sqrt(x * x + y * y)  # hypot takes ten times as long, and no coordinate is near its limits
    if distance > limits.max_range_m or distance < 1e-3:
        return 0
    tolerance = limits.floor_m + limits.per_m * distance
    sectors = len(nearest)
    middle = sector_of(x, y, sectors)
    beside = int(np.ceil(min(tolerance / distance, 0.5) / (2.0 * np.pi) * sectors))
    is_free = True
    sector = (middle - beside) % sectors
    for _ in range(2 * beside + 1):
        near = nearest[sector]
        if near > 0.0 and near - tolerance <= distance <= farthest[sector] + tolerance:
            return -1
        is_free = is_free and near > distance + tolerance
        sector += 1
        if sector == sectors:
            sector = 0
    return 1 if is_free else 0


def testimony(
    points: NDArray[np.float64],
    first: NDArray[np.int64],
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    profiles: Profiles,
    partners: Partners,
    limits: Tolerances,
) -> Testimony:
    """Observations of every scan's points by its partners, given all scans' poses `(n, 3)` and profiles.

    Scan i owns points[first[i]:first[i + 1]] `(m, 2)`, in the robot's frame as the viewpoints `(n, 2)` are. `limits` are the
    distances (m) within which a point counts as on a surface, and the largest range.
    """
    free_by_others = np.zeros(len(points), np.int16)
    occupied_by_others = np.zeros(len(points), np.int16)
    free_by_own = np.zeros(len(points), np.int16)
    run_in_ranges(
        _testimony,
        len(poses),
        (
            points,
            first,
            poses,
            viewpoints,
            profiles,
            partners,
            limits,
            free_by_others,
            occupied_by_others,
            free_by_own,
        ),
    )
    return Testimony(free_by_others, occupied_by_others, free_by_own)


@compiled
def _testimony(
    begin: int,
    end: int,
    points: NDArray[np.float64],
    first: NDArray[np.int64],
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    profiles: Profiles,
    partners: Partners,
    limits: Tolerances,
    free_by_others: NDArray[np.int16],
    occupied_by_others: NDArray[np.int16],
    free_by_own: NDArray[np.int16],
) -> None:
    """Fill in the items begin to end - 1 of `testimony`."""
    for i in range(begin, end):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        for p in range(partners.first[i], partners.first[i + 1]):
            j = partners.scan[p]
            cj, sj = np.cos(poses[j, 2]), np.sin(poses[j, 2])
            for k in range(first[i], first[i + 1]):
                x = poses[i, 0] + c * points[k, 0] - s * points[k, 1] - poses[j, 0]
                y = poses[i, 1] + s * points[k, 0] + c * points[k, 1] - poses[j, 1]
                own_x = cj * x + sj * y - viewpoints[j, 0]
                own_y = -sj * x + cj * y - viewpoints[j, 1]
                said = _verdict(profiles.nearest[j], profiles.farthest[j], own_x, own_y, limits)
                if partners.is_other[p]:
                    free_by_others[k] += said == 1
                    occupied_by_others[k] += said == -1
                else:
                    free_by_own[k] += said == 1


def testimony_of_shifts(
    points: NDArray[np.float64],
    shifts: NDArray[np.float64],
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    profiles: Profiles,
    limits: Tolerances,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Counts `(k,)` of points that scans see free, and `(k,)` on a surface, for each shift `(k, 2)` of the points `(m, 2)`.

    Points and shifts are in the map's frame; `limits` as in `testimony`. The scans' poses `(n, 3)`, viewpoints `(n, 2)` and
    profiles have the same order.
    """
    free, occupied = np.zeros(len(shifts), np.int64), np.zeros(len(shifts), np.int64)
    run_in_ranges(
        _testimony_of_shifts,
        len(shifts),
        (points, shifts, poses, viewpoints, profiles, limits, free, occupied),
    )
    return free, occupied


@compiled
def _testimony_of_shifts(
    first: int,
    last: int,
    points: NDArray[np.float64],
    shifts: NDArray[np.float64],
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    profiles: Profiles,
    limits: Tolerances,
    free: NDArray[np.int64],
    occupied: NDArray[np.int64],
) -> None:
    """Fill in the items first to last - 1 of `testimony_of_shifts`."""
    for k in range(first, last):
        for j in range(len(poses)):
            c, s = np.cos(poses[j, 2]), np.sin(poses[j, 2])
            for i in range(len(points)):
                x = points[i, 0] + shifts[k, 0] - poses[j, 0]
                y = points[i, 1] + shifts[k, 1] - poses[j, 1]
                own_x, own_y = c * x + s * y - viewpoints[j, 0], -s * x + c * y - viewpoints[j, 1]
                said = _verdict(profiles.nearest[j], profiles.farthest[j], own_x, own_y, limits)
                free[k] += said == 1
                occupied[k] += said == -1
