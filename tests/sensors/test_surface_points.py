from __future__ import annotations

import numpy as np

from gridslam.sensors.surface_points import first_in_squares


def test_the_first_point_of_each_square_is_chosen_also_below_zero():
    points = np.array([[0.1, 0.1], [0.2, 0.0], [-0.1, 0.1], [-0.2, 0.2], [0.1, -0.1], [5.0, 7.0]])
    assert sorted(first_in_squares(points, 0.3).tolist()) == [0, 2, 4, 5]
    assert len(first_in_squares(np.zeros((0, 2)), 0.3)) == 0


def test_each_square_has_one_point():
    rng = np.random.default_rng(3)
    points = rng.normal(0.0, 3.0, (500, 2))
    rows = first_in_squares(points, 0.5)
    squares = {(int(x), int(y)) for x, y in np.floor(points / 0.5)}
    assert {(int(x), int(y)) for x, y in np.floor(points[rows] / 0.5)} == squares
    assert len(rows) == len(squares)
