import numpy as np
import pytest

from gridslam.kernels.grids.grid_traversal import advance, start_traversal, steps_to
from tests.reference.ray_traversal import cells_along


def walked(x0, y0, x1, y1):
    """The cells of a traversal from its start to the end's cell."""
    line = start_traversal(x0, y0, x1, y1)
    cells = [(line.row, line.col)]
    for _ in range(steps_to(line, int(np.floor(y1)), int(np.floor(x1)))):
        line = advance(line)
        cells.append((line.row, line.col))
    return cells


@pytest.mark.parametrize("seed", range(5))
def test_the_cells_of_a_line_are_those_of_the_reference_implementation(seed):
    rng = np.random.default_rng(seed)
    for x0, y0, x1, y1 in rng.uniform(-30.0, 30.0, (200, 4)):
        assert walked(x0, y0, x1, y1) == cells_along(x0, y0, x1, y1)


def test_a_line_along_an_axis_crosses_one_row_or_one_column():
    assert walked(0.5, 2.5, 3.5, 2.5) == [(2, 0), (2, 1), (2, 2), (2, 3)]
    assert walked(1.5, 0.5, 1.5, -2.5) == [(0, 1), (-1, 1), (-2, 1), (-3, 1)]


def test_a_line_within_one_cell_takes_no_step():
    assert walked(4.1, 4.2, 4.9, 4.8) == [(4, 4)]


def test_a_line_through_a_corner_takes_the_row_first():
    assert walked(0.5, 0.5, 2.5, 2.5) == [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)]
