"""The map of two drives: a wall that both met stands, although the beams of each graze the cells in which the other met it."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.lidar_slam.grid_map import UPDATE
from gridslam.lidar_slam.sessions.evidence import Evidence
from gridslam.lidar_slam.sessions.session_map import OCCUPIED, joined_log_odds

WALL_ROW, SIZE = 4, 10


def evidence(hits_in_row: int | None) -> Evidence:
    """A wall along a row, which four of seven beams passed; eight beams passed each cell of the rows below its own."""
    hits, misses = np.zeros((2, SIZE, SIZE), np.float32)
    misses[: WALL_ROW + 2] = 8.0
    if hits_in_row is not None:
        misses[hits_in_row], hits[hits_in_row] = 4.0, 3.0
    return Evidence(hits, misses)


def log_odds(of: Evidence) -> np.ndarray:
    return UPDATE.hit * of.hits + UPDATE.miss * of.misses


@pytest.mark.parametrize("rows", [(WALL_ROW, WALL_ROW + 1), (WALL_ROW + 1, WALL_ROW)])
def test_a_wall_that_two_drives_met_in_cells_beside_each_other_stands(rows: tuple[int, int]) -> None:
    before, own = (evidence(row) for row in rows)
    found = joined_log_odds(log_odds(before), log_odds(own), before, own)
    assert (found[list(rows)] > OCCUPIED).any(axis=0).all()
    assert (found[: WALL_ROW - 2] < 0.0).all()


def test_what_one_drive_met_and_the_other_one_passed_is_as_their_sum_says() -> None:
    before, own = evidence(WALL_ROW), evidence(None)
    found = joined_log_odds(log_odds(before), log_odds(own), before, own)
    summed = np.clip(log_odds(before) + log_odds(own), -UPDATE.limit, UPDATE.limit)
    np.testing.assert_array_equal(found, summed)
