"""Edges between places laid into a drawing: their equations against differences of the residuals."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.kernels.drawings.stretched_edges import PlaceEdges, add_edge_equations, edge_residuals
from gridslam.methods.handmap_slam.warp.evidence import to_drawing

JUMP, WEIGHT, STEP = 3.0, 0.5, 1e-6


def some_edges(rng: np.random.Generator) -> tuple[PlaceEdges, np.ndarray]:
    ends = np.array([[0, 1], [1, 2], [2, 0]])
    stds = [rng.uniform(0.1, 0.4, 3) for _ in range(3)]
    states = np.column_stack([rng.normal(0, 1, (3, 2)), rng.uniform(-3, 3, 3), rng.normal(0, 0.2, (3, 2))])
    return PlaceEdges(ends, rng.normal(0, 1, (3, 2)), *stds), states


def test_a_neighbour_is_expected_where_the_map_has_it() -> None:
    edges, states = some_edges(np.random.default_rng(0))
    a, b = states[edges.ends[:, 0]], states[edges.ends[:, 1]]
    scale = np.exp(0.25 * (a[:, 3:] + b[:, 3:]).sum(axis=1))
    gap = (b[:, :2] - to_drawing(a, edges.offsets)) / (scale * edges.offset_std_m)[:, None]
    rotation = se2.wrap_angle(b[:, 2] - a[:, 2]) / edges.rotation_std
    expected = np.column_stack([gap, rotation, (b[:, 3:] - a[:, 3:]) / edges.scale_std[:, None]])
    np.testing.assert_allclose(edge_residuals(edges, states), expected, atol=1e-12)


def test_the_equations_of_edges_are_those_of_their_residuals() -> None:
    edges, states = some_edges(np.random.default_rng(1))
    gradient = np.zeros((3, 5))
    blocks = add_edge_equations(edges, states, JUMP, WEIGHT, gradient)
    matrix = np.zeros((15, 15))
    for (a, b), block in zip(edges.ends, blocks, strict=True):
        for i, left in enumerate((a, b)):
            for j, right in enumerate((a, b)):
                matrix[5 * left : 5 * left + 5, 5 * right : 5 * right + 5] += block[i, j]
    residuals = edge_residuals(edges, states)
    gap = np.hypot(*residuals[:, :2].T)
    weights = WEIGHT / (1.0 + (np.column_stack([gap, gap, residuals[:, 2:]]) / JUMP) ** 2)
    scales = edges.offset_std_m * np.exp(0.25 * states[edges.ends, 3:].sum(axis=(1, 2)))
    slopes = np.zeros((3, 5, 15))
    for k in range(15):
        moved = states.copy().ravel()
        moved[k] += STEP
        # The scale by which distances become metres is held.
        now = edge_residuals(edges, moved.reshape(3, 5))
        held = edges.offset_std_m * np.exp(0.25 * moved.reshape(3, 5)[edges.ends, 3:].sum(axis=(1, 2)))
        now[:, :2] *= (held / scales)[:, None]
        slopes[:, :, k] = (now - residuals) / STEP
    np.testing.assert_allclose(matrix, np.einsum("ek,eki,ekj->ij", weights, slopes, slopes), atol=1e-3)
    np.testing.assert_allclose(
        gradient.ravel(), np.einsum("ek,eki,ek->i", weights, slopes, residuals), atol=1e-3
    )
