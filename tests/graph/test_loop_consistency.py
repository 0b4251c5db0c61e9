"""Sets of loops that agree with each other."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.graph.loop_consistency import CHI2_3DOF_99, departures, largest_cliques, pairwise_disagreement
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import directed_edges
from tests.graph.test_pose_graph import Floats, circle, edges_of


def loops_with(poses: Floats, offsets: Floats) -> Edges:
    pairs = [(k, len(poses) - 6 + k) for k in range(len(offsets))]
    return edges_of(poses, pairs, offsets, True)


def test_loops_that_say_the_same_agree_and_one_that_does_not_stands_alone() -> None:
    poses = circle()
    n = len(poses)
    chain = edges_of(poses, [(k, k + 1) for k in range(n - 1)], np.zeros((n - 1, 3)), False)
    # The true offset of one passage to the other is the same for three loops, seen from each source's frame.
    offset = np.array([0.4, -0.3, 0.05])
    source, target = np.arange(4), n - 6 + np.arange(4)
    moved = se2.compose(offset, poses[target])
    moved[3, 0] += 1.0
    loops = loops_with(poses, np.zeros((4, 3)))
    loops = Edges(source, target, se2.between(poses[source], moved), loops.information, loops.is_loop)
    chi2, std_m = pairwise_disagreement(poses, directed_edges(n, chain), loops)
    assert (chi2[:3, :3] < 1e-9).all()
    assert (chi2[3, :3] > CHI2_3DOF_99).all()
    assert (std_m < 0.2).all()
    cliques = largest_cliques(chi2 < CHI2_3DOF_99)
    np.testing.assert_array_equal(cliques[0], [0, 1, 2])
    np.testing.assert_array_equal(cliques[1], [3])


def test_every_node_is_in_one_clique() -> None:
    rng = np.random.default_rng(1)
    is_consistent = rng.random((12, 12)) < 0.5
    is_consistent |= is_consistent.T
    np.fill_diagonal(is_consistent, False)
    cliques = largest_cliques(is_consistent)
    np.testing.assert_array_equal(np.sort(np.concatenate(cliques)), np.arange(12))
    for clique in cliques:
        assert is_consistent[np.ix_(clique, clique)].sum() == len(clique) * (len(clique) - 1)


def test_a_loop_departs_by_its_offset_over_the_uncertainty_of_the_path_between_its_ends() -> None:
    poses = np.array([(0.0, 0.0, 0.5), (0.0, 0.0, 0.5), (0.0, 0.0, 0.5)])
    steps = Edges(
        np.array([0, 1]),
        np.array([1, 2]),
        np.zeros((2, 3)),
        np.tile(np.diag([1.0 / 0.08, 1.0 / 0.08, 1e6]), (2, 1, 1)),
        np.zeros(2, np.bool_),
    )
    offsets = np.array([(0.0, 0.0, 0.0), (1.5, 0.0, 0.0), (0.0, -3.0, 0.2)])
    information = np.tile(np.diag([1.0 / 0.09, 1.0 / 0.09, 1e6]), (3, 1, 1))
    loops = Edges(np.zeros(3, np.int64), np.full(3, 2), offsets, information, np.ones(3, np.bool_))
    found = departures(poses, directed_edges(3, steps), loops)
    np.testing.assert_allclose(found, [0.0, 3.0, 6.0], atol=1e-3)  # 0.16 + 0.09 m2: 0.5 m
