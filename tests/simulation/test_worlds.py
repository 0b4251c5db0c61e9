"""Every world that ships is valid and can be driven; wrong world files say what is wrong."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gridslam.core.errors import ConfigError
from gridslam.maps.occupancy import GridGeometry
from gridslam.simulation.floor_plan import contour_segments, plan_segments
from gridslam.simulation.scene import Scene
from gridslam.simulation.shapes import Door
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import FloorPlan, builtin_worlds, load_world, validate_world
from tests.conftest import REPOSITORY
from tests.reference.segment_casting import cast_one
from tests.simulation.places import driven, room


@pytest.mark.parametrize("name", builtin_worlds())
def test_every_route_keeps_clear_of_static_shapes(name: str) -> None:
    world, path = load_world(name)
    scene = Scene(world, path.parent)
    route = [world.robot.start[:2], *world.robot.route]
    for start, end in pairwise(route):
        step = np.subtract(end, start)
        length = float(np.hypot(*step))
        if length == 0.0:
            continue
        across = world.robot.radius_m * np.array([-step[1], step[0]]) / length
        for side in (-1.0, 0.0, 1.0):
            ray = np.array([*(np.asarray(start) + side * across), *(step / length)])
            free = scene.cast(ray[None], length + world.robot.radius_m, 0.0).ranges_m[0]
            assert free >= length + world.robot.radius_m - 1e-9, f"{start} to {end} in {name}"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"walls": [{"points": [[0, 0]]}]}, "walls.0: a wall has either two or more points"),
        ({"walls": [{"rectangle": [3, 0, 1, 1]}]}, "walls.0: rectangle: expected x0 < x1"),
        ({"boxs": []}, "boxs: no such key.*did you mean 'boxes'"),
        ({"sensors": {"lidar": {"beam": 3}}}, "sensors.lidar.beam: no such key.*'beams'"),
        ({"sensors": {"lidar": {"sweep_s": 0.5}}}, "a sweep of 0.5 s does not fit 10 scans a second"),
        ({"robot": {"start": [0, 0]}}, "robot.start"),
        ({"walls": []}, "the world is empty"),
        (
            {"doors": [{"id": "a", "hinge": [1, 1]}, {"id": "a", "hinge": [2, 1]}]},
            "the id 'a' is given twice",
        ),
    ],
)
def test_a_wrong_world_file_is_an_error_with_the_key_path(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        room(**change)


TOO_MUCH: list[tuple[dict[str, Any], str]] = [
    ({"sensors": {"infrared": [{"name": "ir", "to_deg": 2**63}]}}, r"infrared\.0\.to_deg"),
    ({"sensors": {"infrared": [{"name": "ir", "step_deg": 1e-6}]}}, "more than 10000 steps"),
    ({"sensors": {"infrared": [{"name": "ir", "from_deg": 5, "to_deg": 1}]}}, "from_deg must not be above"),
    ({"sensors": {"infrared": [{"name": "ir", "range_max_m": 0.1}]}}, "range_min_m must be below"),
    ({"sensors": {"lidar": {"range_min_m": 1.0, "range_max_m": 1.00000001}}}, "range_min_m must be below"),
    ({"sensors": {"lidar": {"extrinsics": {"x": -1e300}}}}, r"extrinsics\.x"),
    ({"sensors": {"odometry": {"rate_hz": 5e-324}}}, "rate_hz"),
    ({"truth": {"resolution_m": 1e300}}, "resolution_m"),
    ({"boxes": [{"centre": [1e300, 0], "size": [1, 1]}]}, r"boxes\.0\.centre"),
    ({"boxes": [{"centre": [1, 1], "size": [1, 1], "colour": [1, 2, 256]}]}, "colour"),
    ({"robot": {"start": [1, 1, 0], "wheels": {"base_m": 5e-324}}}, "base_m"),
    ({"robot": {"start": [1, 1, 0], "laps": 1000, "route": [[1, 1]] * 1001}}, "more than 1000000 waypoints"),
    ({"start_ns": 2**61 - 1}, "start_ns"),
    *[
        ({"sensors": {"infrared": [{"name": name}]}}, r"infrared\.0\.name")
        for name in ("a\nb", "a\n", " a", "a ", "\x1b[2J", "\t")
    ],
]


@pytest.mark.parametrize(("change", "message"), TOO_MUCH)
def test_a_number_that_no_world_has_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        room(**change)


def test_a_true_map_without_margin_holds_the_walls_on_its_edges() -> None:
    world = room(truth={"margin_m": 0})
    found = true_map(Scene(world, Path()), world.truth).probability
    assert found.shape == (100, 160)
    assert (found[-1] == 1).all()
    assert (found[:, -1] == 1).all()


def test_an_unknown_world_is_an_error_that_names_the_nearest() -> None:
    with pytest.raises(ConfigError, match="did you mean 'office'"):
        load_world("ofice")


def test_a_door_turns_about_its_hinge_when_its_waypoint_is_reached() -> None:
    world = room(doors=[{"id": "d", "hinge": [4, 5], "width_m": 1, "openings_deg": {"2": -90}}])
    scene = Scene(world, Path())
    door = world.doors[0]
    assert isinstance(door, Door)
    scene.arrive_at_waypoint(1)
    assert scene.moving_segments[:, [0, 2]].max() == pytest.approx(5.0)
    scene.arrive_at_waypoint(2)
    assert scene.moving_segments[:, [1, 3]].min() == pytest.approx(4.0)
    assert scene.pose_of(door) == pytest.approx([4, 5, -np.pi / 2])


def test_the_true_map_has_walls_where_they_are_and_is_free_where_the_robot_could_go() -> None:
    world = room(boxes=[{"centre": [5, 2.5], "size": [1, 1]}])
    grid = true_map(Scene(world, Path()), world.truth)
    points = np.array([[0.0, 2.5], [8.0, 1.0], [4.5, 2.5], [2.0, 2.0], [5.0, 2.5], [-0.5, 2.0]])
    row, col = grid.geometry.cells(points + 1e-6).T
    values = grid.probability[row, col]
    assert values[:4].tolist() == [1.0, 1.0, 1.0, 0.0]
    assert np.isnan(values[4:]).all()  # inside a box, and outside of the room


def test_the_walls_of_a_map_lie_on_the_borders_of_its_cells() -> None:
    occupied = np.zeros((40, 60), bool)
    occupied[[0, -1]] = True
    occupied[:, [0, -1]] = True
    segments = contour_segments(occupied, GridGeometry(0.1, (-1.0, 2.0)), 0.02)
    ray = np.array([2.0, 4.0, 1.0, 0.0])
    assert cast_one(segments, np.zeros((0, 3)), ray, 50.0) == pytest.approx(5.0 - 0.1 - 2.0, abs=0.02)


def test_a_slanted_wall_of_a_map_becomes_one_smooth_wall() -> None:
    rows, cols = np.mgrid[0:200, 0:200]
    occupied = np.abs(rows - 0.5 * cols - 40) < 2
    segments = contour_segments(occupied, GridGeometry(0.05, (0.0, 0.0)), 0.05)
    assert len(segments) < 20


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["maps/depot.yaml", "maps/warehouse.yaml", "maps/tb3_sandbox.yaml"])
def test_a_world_is_made_from_a_real_map(data_dir: Path, name: str) -> None:
    if not (data_dir / name).exists():
        pytest.skip(f"no {name}")
    segments = plan_segments(FloorPlan(file=str(data_dir / name)), Path())
    assert 4 < len(segments) < 20_000


@pytest.mark.real_data
def test_a_world_is_made_from_a_drawing(data_dir: Path) -> None:
    drawings = sorted((data_dir / "sketches").rglob("*.png"))
    assert drawings
    for drawing in drawings:
        plan = FloorPlan(file=str(drawing), resolution_m=0.1, walls_are="bright")
        assert 4 <= len(plan_segments(plan, Path())) < 20_000


def test_a_plan_without_the_size_of_its_pixels_is_an_error(tmp_path: Path) -> None:
    document = {"plan": {"file": "plan.png"}, "robot": {"start": [0, 0, 0]}}
    (tmp_path / "world.yaml").write_text(yaml.safe_dump(document))
    world, path = load_world(str(tmp_path / "world.yaml"))
    with pytest.raises(ConfigError, match=r"plan.resolution_m: .*is missing"):
        Scene(world, path.parent)


def blocks(language: str) -> list[str]:
    """The code blocks of the simulator's page."""
    text = (REPOSITORY / "docs" / "simulation.md").read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def test_the_world_on_the_simulators_page_can_be_driven() -> None:
    (block,) = blocks("yaml")
    document = {**yaml.safe_load(block), "fixed_cameras": []}
    simulator, events = driven(validate_world(document, "docs/simulation.md"))
    assert simulator.scene.openings == {"door": -80}
    assert len(events) > 1000


def test_the_program_on_the_simulators_page_works() -> None:
    (block,) = blocks("python")
    names: dict[str, Any] = {}
    exec(block.replace("60.0", "1.0"), names)
    assert names["true_pose"].x_m > 8.2


def test_keys_of_earlier_world_files_are_read() -> None:
    former = room(
        doors=[{"id": "d", "hinge": [4, 5], "turns": {"2": -90}}],
        sensors={"lidar": {"mounting": {"x": 0.2}, "stray": 0.01, "tail_share": 0.02}, "fixes": {}},
    )
    present = room(
        doors=[{"id": "d", "hinge": [4, 5], "openings_deg": {"2": -90}}],
        sensors={
            "lidar": {"extrinsics": {"x": 0.2}, "outliers": 0.01, "tail_fraction": 0.02},
            "absolute_poses": {},
        },
    )
    assert former == present
