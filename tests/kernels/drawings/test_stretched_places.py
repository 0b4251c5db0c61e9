"""Places laid into a drawing: the compiled normal equations against the reference."""

from __future__ import annotations

import numpy as np

from gridslam.kernels.drawings.stretched_places import PlacePoints, normal_equations
from tests.reference import stretched_places as reference


def test_the_normal_equations_are_those_of_the_reference() -> None:
    rng = np.random.default_rng(0)
    rows, cols, cell = 60, 80, 0.1
    a, b = 0.03, -0.02  # slopes per cell
    plane = (4.0 + a * np.arange(cols)[None, :] + b * np.arange(rows)[:, None]).astype(np.float32)
    fields = np.stack([plane, np.full_like(plane, a), np.full_like(plane, b)], axis=-1)
    counts = [7, 0, 4]
    offsets = rng.uniform(-1.0, 1.0, (sum(counts), 2))
    points = PlacePoints(offsets, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))
    states = np.column_stack(
        [
            rng.uniform(3.0, 4.0, 3),
            rng.uniform(2.5, 3.5, 3),
            rng.uniform(-3, 3, 3),
            rng.normal(0.0, 0.2, (3, 2)),
        ]
    )
    found = normal_equations(fields, cell, points, states, 0.7)
    for k in range(3):
        mine = offsets[points.starts[k] : points.starts[k + 1]]
        matrix, gradient, cost = reference.normal_equations(plane, cell, mine, states[k], 0.7)
        np.testing.assert_allclose(found.matrix[k], matrix, rtol=1e-3, atol=1e-6)
        np.testing.assert_allclose(found.gradient[k], gradient, rtol=1e-3, atol=1e-6)
        np.testing.assert_allclose(found.cost[k], cost, rtol=1e-4)
