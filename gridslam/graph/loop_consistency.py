"""Loop closures that agree with each other: pairwise consistency and its largest sets (Mangelson et al., ICRA 2018).

Two loops from one passage of the trajectory to another say twice how the passages lie to each other. They agree when the
difference is within what the graph allows for the paths between their ends and for the matches themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.poses import rotate_covariance
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import relative_covariances
from gridslam.kernels.relative_covariance import DirectedEdges

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

CHI2_3DOF_99 = 11.34


def pairwise_disagreement(poses: Floats, graph: DirectedEdges, loops: Edges) -> tuple[Floats, Floats]:
    """Squared Mahalanobis lengths `(m, m)` of the differences between loops, and their largest standard deviations (m).

    `poses` `(n, 3)` are the graph's estimate, `graph` its edges without these loops.
    """
    a, b = loops.source, loops.target
    placed = se2.compose(poses[a], loops.T_source_target)  # where each loop puts its target
    correction = se2.compose(placed, se2.inverse(poses[b]))
    predicted = se2.compose(correction[:, None], poses[b][None])  # by loop i, the target of loop j
    error = placed[None] - predicted
    error[..., 2] = se2.wrap_angle(error[..., 2])
    paths = relative_covariances(poses, graph, a, a) + relative_covariances(poses, graph, b, b)
    own = rotate_covariance(np.asarray(np.linalg.inv(loops.information), np.float64), poses[a, 2])
    lever = predicted - placed[:, None]
    moved = np.broadcast_to(np.eye(3), (*lever.shape[:2], 3, 3)).copy()
    moved[..., 0, 2], moved[..., 1, 2] = -lever[..., 1], lever[..., 0]
    covariance = paths + moved @ own[:, None] @ moved.transpose(0, 1, 3, 2) + own[None]
    chi2 = np.einsum("ijk,ijkl,ijl->ij", error, np.linalg.inv(covariance), error)
    widest = np.sqrt(np.linalg.eigvalsh(covariance[..., :2, :2])[..., 1])
    return np.maximum(chi2, chi2.T), np.maximum(widest, widest.T)


def departures(poses: Floats, graph: DirectedEdges, loops: Edges) -> Floats:
    """Distances `(m,)`, in standard deviations, of the positions that loops measure from those that the graph expects.

    `poses` `(n, 3)` are the graph's estimate, `graph` its edges without these loops.
    """
    a, b = loops.source, loops.target
    error = (se2.compose(poses[a], loops.T_source_target) - poses[b])[:, :2]
    expected = relative_covariances(poses, graph, a, b)[np.arange(len(a)), np.arange(len(a))]
    own = rotate_covariance(np.asarray(np.linalg.inv(loops.information), np.float64), poses[a, 2])
    weight = np.linalg.inv((expected + own)[:, :2, :2])
    return np.asarray(np.sqrt(np.einsum("ij,ijk,ik->i", error, weight, error)))


def largest_cliques(is_consistent: Bools) -> list[Ints]:
    """Disjoint sets of nodes that all agree with each other `(m, m)`, the largest first, each found greedily."""
    left = np.ones(len(is_consistent), np.bool_)
    cliques = []
    while left.any():
        best: list[int] = []
        degree = (is_consistent & left).sum(axis=1)
        for start in np.flatnonzero(left):
            clique, common = [int(start)], is_consistent[start] & left
            common[start] = False
            while common.any():
                options = np.flatnonzero(common)
                inside = (is_consistent[np.ix_(options, options)]).sum(axis=1)
                chosen = int(options[np.lexsort((options, -degree[options], -inside))[0]])
                clique.append(chosen)
                common &= is_consistent[chosen]
                common[chosen] = False
            if len(clique) > len(best):
                best = clique
        cliques.append(np.sort(np.array(best)))
        left[best] = False
    return cliques
