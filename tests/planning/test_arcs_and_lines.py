"""Planned paths are free of collisions, smooth, bounded in curvature and fast; failures name their cause."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import ConfigError, MethodError
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.planning import arcs_and_lines, motion_search
from gridslam.planning.arcs_and_lines import PlannedPath, plan_path
from gridslam.planning.footprint import cover_polygon, disc
from gridslam.planning.options import PlanOptions
from gridslam.planning.travel_time import MAX_LIMIT, MIN_LIMIT, SpeedLimits
from gridslam.report.plan import SEGMENT_COLUMNS, segment_row
from tests.benchmarks.bench_plan import random_pairs
from tests.reference.path_checks import Squares, drive, escapes, largest_jump

Floats = NDArray[np.float64]


def room(yaw_rad: float = 0.0, gap_cells: int = 20) -> OccupancyGrid:
    """A room of 6 x 4 m with a wall in the middle that leaves a gap at its upper end."""
    probability = np.zeros((80, 120), np.float32)
    probability[[0, -1]] = probability[:, [0, -1]] = 1.0
    probability[: 79 - gap_cells, 58:62] = 1.0
    return OccupancyGrid(probability, GridGeometry(0.05, (0.0, 0.0), yaw_rad))


def segments_of(plan: PlannedPath) -> list[dict[str, float]]:
    return [dict(zip(SEGMENT_COLUMNS, segment_row(s), strict=True)) for s in plan.path.segments]  # type: ignore[misc]


def assert_valid(
    plan: PlannedPath, grid: OccupancyGrid, start: Floats, goal: Floats, robot_m: float = 0.2
) -> None:
    """Samples 1 cm apart are free, segments join without a jump, and the ends are start and goal."""
    segments = segments_of(plan)
    poses = np.vstack([drive(segment) for segment in segments])
    assert Squares(grid).distances(poses[:, :2], 0.5).min() >= robot_m - 1e-4
    gap, rotated = largest_jump(segments)
    assert gap < 1e-4
    assert rotated < 1e-6
    np.testing.assert_allclose(poses[0, :2], start[:2], atol=1e-6)
    np.testing.assert_allclose(poses[-1, :2], goal[:2], atol=1e-4)
    for pose, wanted in ((poses[0], start), (poses[-1], goal)):
        if np.isfinite(wanted[2]):
            assert abs(np.angle(np.exp(1j * (pose[2] - wanted[2])))) < 1e-5


START, GOAL = np.array([1.0, 1.0, 0.0]), np.array([5.0, 1.0, -np.pi / 2])


def test_a_path_around_a_wall_is_free_smooth_and_bounded_in_curvature() -> None:
    grid = room()
    plan = plan_path(grid, START, GOAL)
    assert_valid(plan, grid, START, GOAL)
    assert all(abs(s.curvature) <= 1.0 / 0.2 + 1e-9 for s in plan.path.segments)
    assert {s.kind for s in plan.path.segments} == {"arc", "line"}


def test_the_plan_is_the_fastest_candidate() -> None:
    plan = plan_path(room(gap_cells=30), START, GOAL)
    assert len(plan.candidates) > 1
    assert plan.path.time_s == pytest.approx(min(c.time_s for c in plan.candidates))
    assert plan.chosen in {c.name for c in plan.candidates}


def test_a_straight_drive_takes_the_time_of_a_trapezoidal_speed_profile() -> None:
    # 0.5 m/s^2 up to 1 m/s within 1 m, 1 m at 1 m/s, and 1 m down again: 2 + 1 + 2 s.
    plan = plan_path(room(), np.array([1.0, 0.5, np.pi / 2]), np.array([1.0, 3.5, np.pi / 2]))
    assert plan.path.length_m == pytest.approx(3.0)
    assert plan.path.time_s == pytest.approx(5.0)


def test_a_larger_minimum_radius_is_respected() -> None:
    grid = room(gap_cells=35)
    plan = plan_path(grid, START, GOAL, PlanOptions(min_radius_m=0.6))
    assert_valid(plan, grid, START, GOAL)
    assert max(abs(s.curvature) for s in plan.path.segments) <= 1.0 / 0.6 + 1e-9


def test_a_goal_without_a_heading_is_reached_with_any_heading() -> None:
    grid = room()
    goal = np.array([5.0, 1.0, np.nan])
    plan = plan_path(grid, START, goal)
    assert_valid(plan, grid, START, goal)
    assert plan.path.time_s <= plan_path(grid, START, np.array([5.0, 1.0, 0.9])).path.time_s + 1e-6


def test_a_robot_that_turns_on_the_spot_needs_no_room_to_turn() -> None:
    probability = np.ones((20, 120), np.float32)
    probability[5:15, 5:115] = 0.0  # a corridor of half a metre
    grid = OccupancyGrid(probability, GridGeometry(0.05, (0.0, 0.0)))
    start, goal = np.array([1.0, 0.5, np.pi]), np.array([5.0, 0.5, 0.5])
    with pytest.raises(MethodError, match="heading"):
        plan_path(grid, start, goal)
    for radius_m in (0.0, 0.2):
        plan = plan_path(grid, start, goal, PlanOptions(min_radius_m=radius_m, turn_on_spot=True))
        assert_valid(plan, grid, start, goal)
        assert plan.path.segments[0].kind == "turn"
        assert plan.path.segments[0].angle_rad == pytest.approx(np.pi, abs=0.3) or plan.path.segments[
            0
        ].angle_rad == pytest.approx(-np.pi, abs=0.3)


def test_driving_backwards_leads_out_of_a_dead_end() -> None:
    grid = room()
    start, goal = np.array([2.6, 1.0, 0.0]), np.array([5.0, 1.0, 0.0])  # facing the wall
    with pytest.raises(MethodError, match=r"start.*heading"):
        plan_path(grid, start, goal)
    plan = plan_path(grid, start, goal, PlanOptions(reverse=True))
    assert_valid(plan, grid, start, goal)
    assert any(s.length_m < 0.0 for s in plan.path.segments)
    signs = np.sign([s.length_m for s in plan.path.segments])
    for here, after, turned in zip(plan.path.segments, plan.path.segments[1:], np.diff(signs), strict=False):
        if turned:
            assert here.leave_speed == after.enter_speed == 0.0


def test_the_corners_of_a_rectangular_robot_remain_clear_of_walls() -> None:
    grid = room(gap_cells=30)
    corners = np.array([[0.35, 0.2], [-0.15, 0.2], [-0.15, -0.2], [0.35, -0.2]])
    plan = plan_path(grid, START, GOAL, PlanOptions(discs=cover_polygon(corners), min_radius_m=0.3))
    edge = np.concatenate(
        [np.linspace(a, b, 15) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    squares = Squares(grid)
    for pose in np.vstack([drive(s, 0.05) for s in segments_of(plan)]):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        assert squares.distances(edge @ np.array([[c, s], [-s, c]]) + pose[:2], 0.3).min() > 0.0


def test_a_rotated_map_gives_the_rotated_path() -> None:
    straight = plan_path(room(), START, GOAL)
    turned_grid = room(yaw_rad=0.7)
    c, s = np.cos(0.7), np.sin(0.7)
    rotated = [np.array([c * p[0] - s * p[1], s * p[0] + c * p[1], p[2] + 0.7]) for p in (START, GOAL)]
    turned = plan_path(turned_grid, rotated[0], rotated[1])
    assert turned.path.time_s == pytest.approx(straight.path.time_s, rel=1e-3)
    np.testing.assert_allclose(turned.path.segments[-1].end_pose[:2], rotated[1][:2], atol=1e-5)


@pytest.mark.parametrize(
    ("start", "goal", "gap", "message"),
    [
        ((3.0, 1.0, 0.0), GOAL, 20, r"start 3,1: lies inside an obstacle"),
        (
            (9.0, 1.0, 0.0),
            GOAL,
            20,
            r"start 9,1: lies outside the map; it reaches from 0.00,0.00 to 6.00,4.00",
        ),
        ((0.2, 1.0, 0.0), GOAL, 20, r"does not fit there: an obstacle at 0\.0\d,\S+ is 0\.15 m"),
        (START, GOAL, 6, r"the widest passage is only 0\.30 m wide at (2\.[89]|3\.[01])\d*,3\.[78]\d"),
        (START, GOAL, 0, r"obstacles separate them"),
        ((2.65, 1.0, 0.0), GOAL, 20, r"start 2\.65,1: its heading 0 rad cannot be met by arcs of 0\.2 m"),
        (START, (3.35, 1.0, 0.0), 20, r"goal 3\.35,1: its heading"),
    ],
)
def test_the_error_names_what_blocks_the_path(start: Floats, goal: Floats, gap: int, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        plan_path(room(gap_cells=gap), np.array(start), np.array(goal))


def test_unknown_cells_block_unless_the_options_free_them() -> None:
    grid = room()
    grid.probability[59:79, 40:80] = np.nan
    with pytest.raises(MethodError, match="unknown cells separate them"):
        plan_path(grid, START, GOAL)
    assert plan_path(grid, START, GOAL, PlanOptions(unknown_blocks=False)).path.length_m > 4.0
    with pytest.raises(MethodError, match="lies in an unknown cell"):
        plan_path(grid, np.array([2.5, 3.5, 0.0]), GOAL)


def test_unknown_space_around_a_building_blocks_although_its_map_has_an_old_free_threshold(
    tmp_path: Path,
) -> None:
    pixels = np.full((80, 120), 205, np.uint8)
    pixels[20:60, 20:100] = 254
    Image.fromarray(pixels).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(
        "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    grid = load_any_map(tmp_path / "map.yaml")
    assert plan_path(
        grid, np.array([1.5, 2.0, 0.0]), np.array([4.5, 2.0, 0.0])
    ).path.length_m == pytest.approx(3.0)
    with pytest.raises(MethodError, match=r"goal 5\.5,2: lies in an unknown cell"):
        plan_path(grid, np.array([1.5, 2.0, 0.0]), np.array([5.5, 2.0, 0.0]))


def test_a_robot_that_turns_on_the_spot_gets_a_candidate_with_turns_at_corners() -> None:
    grid = room(gap_cells=9)  # 45 cm wide, for a robot of 40 cm
    plan = plan_path(grid, START, GOAL, PlanOptions(min_radius_m=0.0, turn_on_spot=True))
    assert_valid(plan, grid, START, GOAL)
    assert any("corners" in c.name for c in plan.candidates)


def test_a_goal_at_the_start_with_another_heading_is_reached() -> None:
    grid = room()
    goal = np.array([1.0, 1.0, np.pi])
    assert_valid(plan_path(grid, START, goal), grid, START, goal)
    rotated = plan_path(grid, START, goal, PlanOptions(turn_on_spot=True))
    assert [s.kind for s in rotated.path.segments] == ["turn"]
    with pytest.raises(MethodError, match="the same pose"):
        plan_path(grid, START, START)


@pytest.mark.parametrize(
    "options",
    [
        {"min_radius_m": -1.0},
        {"min_radius_m": float("nan")},
        {"min_radius_m": 0.0},
        {"margin_m": 0.0},
        {"occupied_from": 1.5},
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        PlanOptions(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize("limit", [MIN_LIMIT, MAX_LIMIT])
@pytest.mark.parametrize("name", [field.name for field in fields(SpeedLimits)])
def test_every_accepted_limit_gives_finite_times(name: str, limit: float) -> None:
    plan = plan_path(
        room(gap_cells=35), START, GOAL, PlanOptions(limits=replace(SpeedLimits(), **{name: limit}))
    )
    times, poses, speeds = plan.path.sampled(0.05)
    assert np.isfinite(np.column_stack([times, poses, speeds])).all()
    assert (np.diff(times) > 0.0).all()


@pytest.mark.parametrize("limit", [0.0, 1e-300, 1e308, np.inf, np.nan])
@pytest.mark.parametrize("name", [field.name for field in fields(SpeedLimits)])
def test_a_limit_out_of_range_is_refused(name: str, limit: float) -> None:
    with pytest.raises(ConfigError, match=f"{name} .*: expected a number from 0.001 to 1000"):
        replace(SpeedLimits(), **{name: limit})


def test_a_search_is_interrupted_by_whatever_its_report_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_search, "EXPANSIONS_PER_SLICE", 10)
    reported: list[int] = []

    def interrupt(poses: int) -> None:
        reported.append(poses)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan_path(room(), START, GOAL, report=interrupt)
    assert len(reported) == 1
    assert 1 < reported[0] < 10 * motion_search.FIRST_SEARCH_STATES


def test_a_path_beyond_the_limit_of_length_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_search, "MAX_GUIDE_POSES", 10)
    with pytest.raises(MethodError, match="the path would be 0 km long, at most 0 km are planned"):
        plan_path(room(), START, GOAL)


def test_a_path_improved_in_pieces_is_valid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arcs_and_lines, "LONG_PATH_M", 3.0)
    monkeypatch.setattr(arcs_and_lines, "LONG_PATH_MOTIONS", 2)
    grid = room()
    assert_valid(plan_path(grid, START, GOAL), grid, START, GOAL)


def test_the_same_query_gives_the_same_plan() -> None:
    assert plan_path(room(), START, GOAL) == plan_path(room(), START, GOAL)


@pytest.mark.real_data
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["depot", "turtlebot3_world"])
def test_paths_on_public_maps_are_valid(data_dir: Path, name: str) -> None:
    grid = load_any_map(data_dir / "maps" / f"{name}.yaml")
    squares = Squares(grid)
    found = 0
    for i, (start, goal) in enumerate(random_pairs(grid, squares, 10)):
        try:
            plan = plan_path(grid, start, goal, PlanOptions(discs=disc(0.2)))
        except MethodError as error:
            end = start if str(error).startswith("start") else goal + np.array([0.0, 0.0, np.pi])
            assert not escapes(squares, end, 0.2, 0.205, i), str(error)
            continue
        found += 1
        assert_valid(plan, grid, start, goal)
    assert found >= 5
