"""Loop closure and pose graph optimisation over the whole trajectory, after the last scan.

First, key scans are searched for in the submaps that they may see again, by correlative matching in a wide window; the pose
graph of these loops and the front end's steps corrects the trajectory on the large scale. Then every key scan is
registered against every submap in view, and the graph of all these matches corrects it to the centimetre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.lidar_slam.config import LoopClosureConfig
from gridslam.lidar_slam.key_scans import StepNoise
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.submap_matching import SubmapMatcher

Floats = NDArray[np.float64]

MAX_SEARCHES = 3  # loops are searched for again while poses move by more than SEARCH_AGAIN_M
SEARCH_AGAIN_M = 1.5  # half of the search window: loops that lay outside may lie inside now
MAX_REGISTRATIONS = 3  # scans are registered again while poses move by more than CONVERGED_M
CONVERGED_M = 0.05  # registration reaches the same match from poses this close
ROBUST_SCALE = 5.0  # of the kernel on loops, in standard deviations
REJECTED_WEIGHT = 0.1  # a loop with a smaller robust weight counts as rejected


@dataclass(frozen=True, slots=True)
class TrajectoryOptimiser:
    """Settings: where loops are searched for, the noise of the front end's steps, memory of the submaps."""

    loop_closure: LoopClosureConfig
    step_noise: StepNoise
    memory_limit_mb: float


@dataclass(frozen=True, slots=True)
class OptimisedTrajectory:
    """Poses `(n, 3)` of the key scans, and numbers of pairs searched, loops found, loops rejected and final matches."""

    poses: Floats
    pairs_searched: int
    loops_found: int
    loops_rejected: int
    matches: int

    @property
    def measures(self) -> dict[str, object]:
        """The numbers, for the report."""
        return {
            "pairs_searched": self.pairs_searched,
            "loops_found": self.loops_found,
            "loops_rejected": self.loops_rejected,
            "matches": self.matches,
        }


def optimise_trajectory(
    scans: Sequence[PreparedScan],
    poses: Floats,
    track: Floats,
    settings: TrajectoryOptimiser,
    landmarks: Edges | None = None,
) -> OptimisedTrajectory:
    """Optimised poses `(n, 3)` of the key scans; the first one is held.

    `track` `(n, 3)` are the front end's poses of the same scans, which are accurate over short distances. `landmarks` are
    additional edges between the key scans. Raises MethodError if the submaps would exceed the memory limit.
    """
    if len(scans) < 3:
        return OptimisedTrajectory(poses.copy(), 0, 0, 0, 0)
    matcher = SubmapMatcher.of(scans, settings.loop_closure, settings.memory_limit_mb)
    fixed = _odometry_edges(track, settings.step_noise)
    if landmarks is not None and len(landmarks):
        fixed = Edges.concatenate([fixed, landmarks])
    estimate, loops = poses, Edges.none()
    searched = rejected = 0
    for _ in range(MAX_SEARCHES):
        before = estimate
        found, pairs = matcher.search_loops(before)
        searched += pairs
        loops = Edges.concatenate([loops, found])
        estimate, weights = optimise(before, Edges.concatenate([fixed, loops]), ROBUST_SCALE)
        rejected = int(np.count_nonzero(weights[len(fixed) :] < REJECTED_WEIGHT))
        if _largest_move_m(before, estimate) < SEARCH_AGAIN_M:
            break
    matches = loops
    for _ in range(MAX_REGISTRATIONS):
        before = estimate
        matches = matcher.match_in_view(before)
        estimate, _ = optimise(before, Edges.concatenate([fixed, matches]), ROBUST_SCALE)
        if _largest_move_m(before, estimate) < CONVERGED_M:
            break
    return OptimisedTrajectory(estimate, searched, len(loops), rejected, len(matches))


def _largest_move_m(before: Floats, after: Floats) -> float:
    """Largest distance between corresponding poses `(n, 3)`."""
    return float(np.hypot(*(after - before)[:, :2].T).max())


def _odometry_edges(track: Floats, noise: StepNoise) -> Edges:
    """The front end's motions from key scan to key scan."""
    n = len(track)
    steps = se2.between(track[:-1], track[1:])
    information = (1.0 / noise.std(steps) ** 2)[:, :, None] * np.eye(3)
    return Edges(np.arange(n - 1), np.arange(1, n), steps, information, np.zeros(n - 1, np.bool_))
