from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from gridslam.maps.distances import distances_to


@pytest.mark.parametrize("shape", [(1, 1), (7, 300), (61, 97), (400, 350)])
def test_distances_are_exact(shape: tuple[int, int]) -> None:
    cells = np.random.default_rng(0).random(shape) < 0.01
    cells[0, 0] = True
    assert np.array_equal(distances_to(cells), distance_transform_edt(~cells).astype(np.float32))


def test_without_a_marked_cell_they_are_infinite() -> None:
    assert np.isposinf(distances_to(np.zeros((3, 4), bool))).all()


def test_the_last_digit_depends_on_neither_threads_nor_memory_addresses() -> None:
    """Runs with the same seed give the same bytes; a loop closure amplifies a difference in the last digit."""
    cells = np.random.default_rng(1).random((60, 90)) < 0.003
    threads = cv2.getNumThreads()
    found = set()
    try:
        for count in (1, 2):
            cv2.setNumThreads(count)
            for offset in range(8):
                place = np.empty(cells.size + 8, bool)[offset : offset + cells.size].reshape(cells.shape)
                place[...] = cells
                found.add(distances_to(place).tobytes())
    finally:
        cv2.setNumThreads(threads)
    assert len(found) == 1


def test_the_callers_choice_of_libraries_is_restored() -> None:
    before = cv2.ipp.useIPP()
    distances_to(np.eye(5, dtype=bool))
    assert cv2.ipp.useIPP() == before
