"""The relations metric of the SLAM benchmark (Kuemmerle et al., Autonomous Robots 2009)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.pose_errors import PoseErrors


@dataclass(frozen=True, slots=True)
class Relations:
    """True relative motions: `motions[k]` (x, y, yaw) is the pose at `to_ns[k]` in the frame of the pose at `from_ns[k]`."""

    from_ns: NDArray[np.int64]
    to_ns: NDArray[np.int64]
    motions: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.from_ns)


@dataclass(frozen=True, slots=True)
class RelationErrors:
    """Errors of the relations within the trajectory; `missed` relations have a stamp outside it."""

    errors: PoseErrors
    missed: int


def relation_errors(trajectory: Trajectory, relations: Relations) -> RelationErrors:
    """Errors of the relations: the inverse of the true motion composed with the estimated one (Kuemmerle 2009, eq. 2).

    The trajectory is sorted by stamp; the poses at the two stamps of a relation are interpolated.
    """
    path = trajectory.sorted()
    start, start_inside = path.at(relations.from_ns)
    end, end_inside = path.at(relations.to_ns)
    scored = start_inside & end_inside
    motion = se2.between(start[scored], end[scored])
    error = se2.between(relations.motions[scored], motion)
    return RelationErrors(
        PoseErrors(np.hypot(error[:, 0], error[:, 1]), np.rad2deg(np.abs(error[:, 2]))),
        missed=int(np.count_nonzero(~scored)),
    )
