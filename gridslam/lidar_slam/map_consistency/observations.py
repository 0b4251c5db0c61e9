"""Comparison of the scans of a finished map: which points of each scan the others see as surface, and which as free space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.kernels.grids import free_space
from gridslam.lidar_slam.map_consistency.passages import Passages
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECTORS = 256
MAX_POINTS = 160  # largest number of points of a scan that are compared with others
TOLERANCES = free_space.Tolerances(floor_m=0.3, per_m=0.01, max_range_m=15.0)


@dataclass(frozen=True, slots=True)
class Observations:
    """Scans at their poses `(n, 3)`, and points of them in the map frame `(m, 2)` with the observations of each by other scans.

    Scan i owns the points first[i]..first[i + 1]; `scan` `(m,)` are the points' scans.
    """

    poses: Floats
    viewpoints: Floats
    profiles: free_space.Profiles
    points: Floats
    first: Ints
    scan: Ints
    testimony: free_space.Testimony

    @property
    def is_compared(self) -> Bools:
        """Mask `(m,)` of the points that another passage observes, and that their own passage does not see through."""
        said = self.testimony.free_by_others + self.testimony.occupied_by_others > 0
        return np.asarray(said & (self.testimony.free_by_own == 0))

    @property
    def is_contradicted(self) -> Bools:
        """Mask `(m,)` of the compared points that more of the other passages see free than occupied."""
        is_majority = self.testimony.free_by_others > self.testimony.occupied_by_others
        return np.asarray(self.is_compared & is_majority)

    def of_shifts(self, points: Floats, shifts: Floats, scans: Ints) -> tuple[Ints, Ints]:
        """Counts `(s,)` of points `(k, 2)` that the `scans` see free, and occupied, for each shift `(s, 2)` of the points.

        Points and shifts are in the map frame (m); `scans` are rows.
        """
        profiles = free_space.Profiles(self.profiles.nearest[scans], self.profiles.farthest[scans])
        free, occupied = free_space.testimony_of_shifts(
            points,
            shifts,
            poses=self.poses[scans],
            viewpoints=self.viewpoints[scans],
            profiles=profiles,
            limits=TOLERANCES,
        )
        return free, occupied


def observe(scans: Sequence[PreparedScan], rows: Ints, poses: Floats, passages: Passages) -> Observations:
    """The observations of the scans in `rows` `(n,)` at their poses `(n, 3)`."""
    taken = [_parts_of(scans[row]) for row in rows]
    viewpoints = np.array([viewpoint for viewpoint, _, _ in taken])
    returns = [points for _, points, _ in taken]
    profiles = free_space.Profiles(
        *free_space.scan_profiles(np.concatenate(returns), offsets_of(map(len, returns)), viewpoints, SECTORS)
    )
    chosen = [points for _, _, points in taken]
    first = offsets_of(map(len, chosen))
    testimony = free_space.testimony(
        np.concatenate(chosen),
        first,
        poses=poses,
        viewpoints=viewpoints,
        profiles=profiles,
        partners=passages.partners,
        limits=TOLERANCES,
    )
    in_map = [se2.transform_points(pose, points) for pose, points in zip(poses, chosen, strict=True)]
    scan = np.repeat(np.arange(len(rows)), np.diff(first))
    return Observations(
        poses,
        viewpoints,
        profiles=profiles,
        points=np.concatenate(in_map),
        first=first,
        scan=scan,
        testimony=testimony,
    )


def _parts_of(scan: PreparedScan) -> tuple[Floats, Floats, Floats]:
    """The viewpoint (2,) and the returns of a scan, and the points that are compared with others; the rest is not kept."""
    return scan.viewpoint, scan.returns, scan.subset(MAX_POINTS).points
