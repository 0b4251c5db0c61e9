"""The drawing laid over the finished map."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.methods.handmap_slam.warp.places import PlaceGraph, distances_along
from gridslam.methods.handmap_slam.warp.repair import SLIDE_M, from_exits, slid, unlocated_stretches
from gridslam.methods.handmap_slam.warp.results import doubt_about, notes_about
from gridslam.methods.handmap_slam.warp.search import distinct
from gridslam.methods.handmap_slam.warp.warp import DrawingWarp
from tests.benchmarks.bench_drawn_buildings import trial
from tests.benchmarks.mapped_buildings import mapped_building
from tests.benchmarks.people_drawings import drawing_of


def test_a_person_s_drawing_is_laid_over_the_map_and_the_robot_is_within_a_metre() -> None:
    found = trial(3)
    assert found.fits
    assert found.within_1m > 0.95


def test_the_drawing_of_another_building_does_not_fit() -> None:
    found = trial(212, is_wrong=True)
    assert not found.fits
    assert found.doubtful == 1.0


@pytest.mark.parametrize(
    ("doubtful_places", "status", "is_noted"),
    [(0, None, False), (1, None, False), (6, None, True), (20, "lost", False)],
)
def test_a_run_is_lost_if_all_of_its_path_may_lie_elsewhere_in_the_drawing_and_says_so_of_a_part(
    doubtful_places: int, status: str | None, is_noted: bool
) -> None:
    places = 20
    none = [np.zeros((0, 2))] * places
    graph = PlaceGraph(
        centres=np.zeros((places, 2)),
        parents=np.arange(places) - 1,
        edges=np.zeros((0, 2), np.int64),
        views=none,
        open_views=none,
        owners=np.arange(places),
    )
    doubtful = np.arange(places) < doubtful_places
    warp = DrawingWarp(
        graph,
        np.zeros((places, 5)),
        cost_per_place=3.0,
        deformation_per_place=0.2,
        contradictions_per_place=0.3,
        doubtful=doubtful,
    )
    doubt = doubt_about(warp)
    assert (doubt and doubt.status) == status
    said = [doubt.reason] if doubt is not None else list(notes_about(warp))
    assert bool(said) == (is_noted or status is not None)
    assert all(f"{doubtful_places / places:.0%} of the path" in line for line in said)


def chain(places: int) -> PlaceGraph:
    """Places a metre apart in a row, each entered from the one before."""
    at = np.arange(places)
    return PlaceGraph(
        centres=np.column_stack([at, 0.0 * at]),
        parents=at - 1,
        edges=np.column_stack([at[:-1], at[1:]]),
        views=[np.full((1, 2), float(k)) for k in at],
        open_views=[np.zeros((0, 2))] * places,
        owners=at,
    )


def test_a_region_is_searched_backwards_from_where_the_robot_left_it_if_the_map_fits_there() -> None:
    region = np.array([False, True, True, True, False, False])
    found = from_exits(chain(6), region, costs=np.array([1.0, 5.0, 5.0, 5.0, 1.0, 1.0]))
    assert found is not None
    order, parents = found
    assert order[-3:].tolist() == [3, 2, 1]
    assert parents[[3, 2, 1]].tolist() == [4, 3, 2]
    graph = chain(6).in_order(order, parents)
    assert graph.parents[-3:].tolist() == [order.tolist().index(4), 3, 4]
    assert [view[0, 0] for view in graph.views] == order.tolist()
    assert (graph.edges[:, 0] < graph.edges[:, 1]).all()
    assert from_exits(chain(6), region, costs=np.array([1.0, 5.0, 5.0, 5.0, 9.0, 9.0])) is None


def test_a_region_is_moved_along_and_across_as_a_whole_and_its_ends_less() -> None:
    graph = chain(30)
    states = np.zeros((30, 5))
    states[:, :2] = graph.centres
    region = (np.arange(30) > 5) & (np.arange(30) < 25)
    moved = np.array([each - states for each in slid(states, region, distances_along(graph))])
    assert np.abs(moved[:, ~region]).max() == 0.0
    np.testing.assert_allclose(np.abs(moved[:, 15, :2]).sum(axis=1), SLIDE_M)
    np.testing.assert_allclose(np.abs(moved[:, 6, :2]).sum(axis=1), 0.5)
    np.testing.assert_allclose(moved[:, 15, :2].sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("places", "change", "doubted"), [(30, 0.4, True), (30, 0.0, False), (12, 0.4, False)]
)
def test_places_in_a_long_plain_stretch_are_doubted_if_its_scale_changes(
    places: int, change: float, doubted: bool
) -> None:
    fixed = np.zeros(places, np.bool_)
    fixed[[0, -1]] = True
    log_scales = np.column_stack([np.linspace(0.0, change, places), np.zeros(places)])
    found = unlocated_stretches(fixed, log_scales, distances_along(chain(places)))
    assert found[places // 2] == doubted
    assert found.any() == doubted


def test_fits_are_distinct_if_some_of_their_places_are_apart() -> None:
    lines = np.zeros((300, 30, 5))
    lines[100:200, :10, 0] = 3.0
    lines[200:, :3, 0] = 3.0
    chosen = distinct(lines, np.ones(30, np.bool_), 5)
    np.testing.assert_array_equal([line[0, 0] for line in chosen], [0.0, 3.0])


def test_the_true_correspondence_has_no_error() -> None:
    mapped = mapped_building(3)
    drawing = drawing_of(mapped.building, 3)
    points = mapped.poses[:, :2]
    np.testing.assert_allclose(drawing.errors_m(points, drawing.in_drawing(points)), 0.0, atol=1e-9)
