"""What the warp is made of: its sparse matrix, particles over places, and what speaks against a fit."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.drawings.drawn_field import crossed_segments
from gridslam.maps.drawings.drawing import Drawing, DrawnMap, drawn_map
from gridslam.methods.handmap_slam.warp.block_matrix import BlockMatrix
from gridslam.methods.handmap_slam.warp.contradictions import (
    CROSSED_COST,
    FOLDED_COST,
    UNSEEN_COST,
    DrawingContradictions,
)
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence
from gridslam.methods.handmap_slam.warp.places import PlaceGraph
from gridslam.methods.handmap_slam.warp.search import RESCALED, Known, PlaceLineage, rescaled


def chain(places: int) -> PlaceGraph:
    """Places a metre apart along x, that see a wall a metre beside them."""
    at = np.arange(places)
    return PlaceGraph(
        centres=np.column_stack([at, 0.0 * at]).astype(np.float64),
        parents=at - 1,
        edges=np.column_stack([at[:-1], at[1:]]),
        views=[np.array([[0.0, 1.0]])] * places,
        open_views=[np.zeros((0, 2))] * places,
        owners=at,
    )


def test_a_matrix_of_blocks_is_solved_like_a_dense_one() -> None:
    rng = np.random.default_rng(0)
    places = 6
    ends = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 0]])
    rows = rng.normal(0.0, 1.0, (len(ends), 5, 10))
    dense = np.eye(5 * places)
    values = [np.eye(5)] * places
    blocks = [(k, k) for k in range(places)]
    for (a, b), row in zip(ends.tolist(), rows, strict=True):
        product = row.T @ row
        for i, left in enumerate((a, b)):
            for j, right in enumerate((a, b)):
                part = product[5 * i : 5 * i + 5, 5 * j : 5 * j + 5]
                dense[5 * left : 5 * left + 5, 5 * right : 5 * right + 5] += part
                values.append(part)
                blocks.append((left, right))
    right_side = rng.normal(0.0, 1.0, 5 * places)
    found = BlockMatrix(places, np.array(blocks)).solve(np.array(values), right_side)
    np.testing.assert_allclose(found, np.linalg.solve(dense, right_side), rtol=1e-9)


def test_the_particles_of_now_keep_the_places_of_those_that_they_came_from() -> None:
    graph = chain(3)
    lineage = PlaceLineage(graph, Known(np.zeros(3, np.bool_), np.zeros((3, 5))), particles=3)
    names = np.arange(3.0)[:, None] * np.ones(5)
    lineage.add(0, names)
    lineage.resample(np.array([2, 2, 0]))
    lineage.add(1, 10.0 + lineage.at(0))
    lineage.resample(np.array([1, 2, 2]))
    lineage.add(2, 100.0 + lineage.at(1))
    found = lineage.lines(np.array([0, 1, 2]))[:, :, 0]
    np.testing.assert_array_equal(found, [[2.0, 12.0, 112.0], [0.0, 10.0, 110.0], [0.0, 10.0, 110.0]])


@pytest.mark.parametrize(("y", "crosses"), [(5.0, True), (5.65, False)])
def test_a_segment_crosses_a_wall_but_not_its_door(y: float, crosses: bool) -> None:
    walls = np.zeros((100, 100), np.bool_)
    walls[:, 50] = True
    walls[53:60, 50] = False
    ends = np.array([[8.0, y]])
    assert crossed_segments(walls, 0.1, ends - (6.0, 0.0), ends)[0] == crosses


def corridor_with_a_wall_across() -> DrawnMap:
    """Two strokes along x with another one across in the middle, which has no door."""
    levels = np.full((60, 120), 255, np.uint8)
    for row in (20, 40):
        levels[row, 10:110] = 0
    levels[20:40, 60] = 0
    levels[20:40, [10, 109]] = 0
    return drawn_map(Drawing(levels, "corridor"), start_xy=(3.0, 3.0))


def test_a_fit_that_leads_through_a_wall_and_leaves_half_of_the_drawing_over_costs_more() -> None:
    drawn = corridor_with_a_wall_across()
    graph = chain(4)
    against = DrawingContradictions(graph, DrawnEvidence(drawn))
    states = np.zeros((4, 5))
    states[:, :2] = graph.centres + np.array([2.0, 3.0])
    across = states + np.array([2.5, 0.0, 0.0, 0.0, 0.0])
    assert not against.crossed(states).any()
    assert int(against.crossed(across).sum()) == 1
    unseen = against.unseen_fraction(states)
    assert 0.5 < unseen < 1.0
    assert against.cost(states) == pytest.approx(UNSEEN_COST * 4 * unseen)
    assert against.cost(across) >= CROSSED_COST


def test_a_fit_that_lays_one_part_of_the_map_over_another_costs_more_and_names_both() -> None:
    graph = chain(10)
    against = DrawingContradictions(graph, DrawnEvidence(corridor_with_a_wall_across()))
    states = np.zeros((10, 5))
    states[:, :2] = graph.centres * 0.4 + np.array([2.0, 3.0])
    states[:, 3:] = np.log(0.4)
    folded = states.copy()
    folded[7:, 0] = states[2:5, 0]  # five metres of the map are at no distance in the drawing
    assert not against.folded(states).any()
    assert np.flatnonzero(against.folded(folded)).tolist() == [2, 3, 4, 7, 8, 9]
    assert against.cost(folded) - against.cost(states) > 0.5 * 6 * FOLDED_COST


def test_some_particles_draw_what_follows_at_another_scale_in_the_same_place() -> None:
    states = np.tile(np.array([3.0, 4.0, 0.5, 0.1, 0.2]), (4000, 1))
    after = rescaled(states, np.random.default_rng(0))
    np.testing.assert_array_equal(after[:, :3], states[:, :3])
    changed = (after[:, 3:] != states[:, 3:]).any(axis=1)
    assert changed.mean() == pytest.approx(RESCALED, abs=0.02)
    assert np.abs(after[changed, 3:] - states[changed, 3:]).max() > np.log(2.0)
