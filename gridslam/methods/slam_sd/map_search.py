"""Matching of particles to their maps again after new ground: by the shape of the recent path, not by one scan.

In a corridor of equal bays one scan matches at every bay. A submap of the key scans that are in no map yet is longer than a
bay, and most of it must lie on the old map's surfaces: a wrong bay does not survive that, and a right one is found a few metres
later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.scan_matching.surfel_registration import PosePriors
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.drift import Drift
from gridslam.methods.slam_sd.particle_grids import Matches, ParticleGrids

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SUBMAP_STEP = 6  # every sixth of the recent key scans
SUBMAP_POINTS = 40  # number of points of each of them
STARTS = 6  # number of start poses of a search, drawn from the drift
START_STD = np.array([0.5, 0.5, 0.05])  # x, y (m), yaw (rad), added to the drift: the map may be deformed
MIN_GAIN = 0.3  # log likelihood per point by which a found pose must be better than the predicted one


class Search(NamedTuple):
    """The poses `(n, 3)` predicted for all particles, their drift, and which of them `(n,)` search for their maps."""

    predicted: Floats
    drift: Drift
    lost: Bools


@dataclass(frozen=True, slots=True)
class RecentSubmap:
    """Points of recent key scans, each in its own frame, with its pose (3,) in the frame of the last one."""

    scans: list[tuple[PreparedScan, Floats]]

    @classmethod
    def of(cls, scans: Sequence[PreparedScan], track: Sequence[Floats]) -> RecentSubmap:
        """The submap of key scans with the front end's poses (3,); the last one is always in it."""
        rows = range(len(scans) - 1, -1, -SUBMAP_STEP)
        return cls([(scans[k], se2.between(track[-1], track[k])) for k in rows])

    @property
    def last_points(self) -> OrientedPoints:
        """Points of the last scan alone."""
        return self.scans[0][0].subset(2 * SUBMAP_POINTS)

    def points(self) -> OrientedPoints:
        """All points in the frame of the last scan."""
        parts = [(scan.subset(SUBMAP_POINTS), pose) for scan, pose in self.scans]
        rotations = [np.array([0.0, 0.0, pose[2]]) for _, pose in parts]
        return OrientedPoints(
            np.concatenate([se2.transform_points(pose, part.points) for part, pose in parts]),
            np.concatenate(
                [se2.transform_points(r, part.normals) for r, (part, _) in zip(rotations, parts, strict=True)]
            ),
        )

    def mean_log_likelihood(self, grids: ParticleGrids, poses: Floats) -> Floats:
        """Log likelihood per point `(n,)`, free space included, with the last scan at `poses` `(n, 3)` in the particles' maps."""
        total, count = np.zeros(len(poses)), 0
        for scan, pose in self.scans:
            points = scan.subset(SUBMAP_POINTS)
            total += grids.log_likelihood(scan.viewpoint, points, se2.compose(poses, pose))
            count += len(points.points)
        return np.asarray(total / max(count, 1))


def search_maps(
    grids: ParticleGrids,
    recent: RecentSubmap,
    search: Search,
    min_inlier_ratio: float,
    rng: np.random.Generator,
) -> Matches:
    """Matches of the submap of recent key scans in the lost particles' maps; the inlier ratio is 0 where none was found.

    From the predicted poses, and from poses drawn from the drift, the last scan is registered first. Where it matches, the whole
    submap must match as well, and be clearly likelier than at the predicted pose.
    """
    predicted, drift, lost = search
    priors = PosePriors(predicted, drift.information(START_STD))
    last, submap = recent.last_points, recent.points()
    best = Matches(predicted.copy(), np.zeros((len(lost), 3, 3)), np.zeros(len(lost)))
    for attempt in range(STARTS + 1):
        starts = predicted + drift.sample(rng, START_STD) if attempt else predicted
        found = grids.register(last, starts, priors, min_inlier_ratio)
        candidates = lost & (found.inlier_ratio >= min_inlier_ratio)
        if not candidates.any():
            continue
        starts = np.where(candidates[:, None], found.poses, predicted)
        found = grids.register(submap, starts, priors, min_inlier_ratio)
        better = candidates & (found.inlier_ratio >= np.maximum(min_inlier_ratio, best.inlier_ratio))
        for old, new in zip(best, found, strict=True):
            old[better] = new[better]
    if best.inlier_ratio.any():
        gain = recent.mean_log_likelihood(grids, best.poses) - recent.mean_log_likelihood(grids, predicted)
        best.inlier_ratio[gain <= MIN_GAIN] = 0.0
    # the submap has more points than a scan, but their errors are not more independent
    return best._replace(information=best.information * (len(last.points) / max(len(submap.points), 1)))
