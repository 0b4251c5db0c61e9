"""Furniture of the map does not hide what is behind it; walls do."""

from __future__ import annotations

import numpy as np

from gridslam.methods.ispace_mcl.lasting_walls import lasting_walls


def room() -> np.ndarray:
    occupied = np.zeros((80, 120), bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True  # 6 m x 4 m at 5 cm
    return occupied


def test_pieces_of_the_size_of_furniture_are_left_out() -> None:
    furnished = room()
    furnished[20:30, 40:60] = True  # a desk of 1 m
    furnished[50, 20:90] = True  # a partition of 3.5 m
    expected = room()
    expected[50, 20:90] = True
    np.testing.assert_array_equal(lasting_walls(furnished, 0.05), expected)


def test_all_pieces_of_a_map_without_long_walls_are_kept() -> None:
    speckled = room()
    speckled[:, ::7] = speckled[::7] = False
    np.testing.assert_array_equal(lasting_walls(speckled, 0.05), speckled)
