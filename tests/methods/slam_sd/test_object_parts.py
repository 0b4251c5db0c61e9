"""Parts of the objects: walls, doors, visits, episodes, constraints of the path, maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import optimise
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.slam_sd.objects.composition import compose_map
from gridslam.methods.slam_sd.objects.doors import closed_yaw_of
from gridslam.methods.slam_sd.objects.landmarks import Reobservation, landmark_edges, log_object_weights
from gridslam.methods.slam_sd.objects.object_history import ObjectEpisode, ObjectHistory
from gridslam.methods.slam_sd.objects.object_model import ObjectModel, object_models
from gridslam.methods.slam_sd.objects.point_masks import points_on
from gridslam.methods.slam_sd.objects.smoothing import episodes_of, estimates_of_one_hinge
from gridslam.methods.slam_sd.objects.tag_visits import OpenVisits
from gridslam.methods.slam_sd.objects.visit_evidence import InventoryRound
from gridslam.methods.slam_sd.objects.walls import Walls, find_walls

SECOND = 1_000_000_000


def entry(name: str, hinge: tuple[float, float] | None = None) -> dict[str, object]:
    corners = [[0, -0.02], [0.9, -0.02], [0.9, 0.02], [0, 0.02]]
    return {"id": name, "class": "x", "footprint": corners, "tags": [{"id": f"tag-{name}"}], "hinge": hinge}


def model_of(hinge: tuple[float, float] | None = None) -> ObjectModel:
    return object_models(TagDatabase.model_validate({"objects": [entry("a", hinge)]}))[0]


def episode(anchor: int, pose: tuple[float, float, float], first_s: int, reads: int = 5) -> ObjectEpisode:
    covariance = np.diag([0.01, 0.01, 0.01]) ** 2
    return ObjectEpisode(
        anchor, np.array(pose), covariance, first_s * SECOND, (first_s + 2) * SECOND, reads, 50.0
    )


def far_apart(a: np.ndarray, b: np.ndarray) -> bool:
    return float(np.hypot(*(a - b)[:2])) > 0.15


def wall_points(rng: np.random.Generator, door_m: float) -> np.ndarray:
    """A wall along y = 1 with a closed door 2 cm before it, another wall at right angles, and a box."""
    along = np.sort(rng.uniform(-3, 3, 600))
    before = np.where(np.abs(along) < 0.5 * door_m, 0.02, 0.0)
    first = np.column_stack([along, 1.0 - before + rng.normal(0, 0.006, 600)])
    second = np.column_stack([3.0 + rng.normal(0, 0.006, 200), rng.uniform(-1, 1, 200)])
    box = np.column_stack([rng.uniform(-0.25, 0.25, 100), 0.5 + rng.normal(0, 0.006, 100)])
    return np.concatenate([first, second, box])


def test_walls_are_found_behind_the_doors_in_them() -> None:
    walls = find_walls(wall_points(np.random.default_rng(0), 1.6), 1.5)
    assert len(walls) == 2
    on_wall = np.array([[-2.0, 1.0], [2.0, 1.0]])
    assert walls.distances(on_wall).max() < 0.004
    assert abs(walls.distances(np.array([[0.0, 0.98]]))[0] - 0.02) < 0.004


def test_short_surfaces_are_no_walls_and_walls_end_where_they_were_observed() -> None:
    points = wall_points(np.random.default_rng(1), 0.6)
    walls = find_walls(points, 1.5)
    assert walls.distances(np.array([[0.0, 0.5]]))[0] > 0.3
    assert np.isinf(walls.distances(np.array([[20.0, 30.0]]))[0])
    assert np.isinf(find_walls(points[:10], 1.5).distances(points[:3])).all()


def test_the_closed_yaw_of_a_door_lies_along_its_wall_also_when_it_opens_wide() -> None:
    walls = Walls(np.array([[0.0, 1.0]]), np.array([1.0]), np.array([[-4.0, 4.0]]))
    assert closed_yaw_of(np.array([0.5, 1.0, 0.4]), walls, None) == pytest.approx(0.0)
    assert abs(closed_yaw_of(np.array([0.5, 1.0, 2.9]), walls, None) or 0.0) == pytest.approx(np.pi)
    assert closed_yaw_of(np.array([0.5, 1.0, 1.9]), walls, 0.05) == pytest.approx(0.0)
    assert closed_yaw_of(np.array([0.5, 3.0, 0.4]), walls, None) is None


def test_a_visit_ends_with_a_pause_and_two_tags_of_one_object_are_one_read() -> None:
    visits = OpenVisits({"front": "bin", "back": "bin"})
    for second in (0, 1, 2):
        visits.add(InventoryRound(second * SECOND, np.zeros(3), ("front", "back", "unknown")))
    assert visits.counters["tags.unknown_id"] == 3
    assert not visits.take_ended(5 * SECOND)
    ended = visits.take_ended(7 * SECOND)
    assert (ended["bin"].reads, ended["bin"].last_ns) == (3, 2 * SECOND)
    assert "bin" not in visits


def test_an_estimate_at_another_place_begins_an_episode() -> None:
    path = np.zeros((3, 3))
    path[1:, 0] = [0.05, 0.0]
    estimates = [episode(0, (1, 0, 0), 0), episode(1, (1, 0, 0), 10), episode(2, (2, 0, 0), 20)]
    episodes = episodes_of(estimates, path, far_apart)
    assert [e.reads for e in episodes] == [10, 5]
    assert (episodes[0].first_ns, episodes[0].last_ns) == (0, 12 * SECOND)
    found = ObjectHistory(model_of(), episodes, estimates)
    assert found.has_moved
    assert found.at(5 * SECOND) == episodes[:1]
    assert found.at(15 * SECOND) == episodes
    assert found.at(25 * SECOND) == episodes[1:]


def test_an_object_that_is_gone_is_not_present_and_has_moved() -> None:
    found = ObjectHistory(model_of(), [replace(episode(0, (1, 0, 0), 0), gone_ns=9 * SECOND)])
    assert found.has_moved
    assert found.present is None
    assert not found.at(10 * SECOND)


def test_an_estimate_whose_hinge_is_elsewhere_is_dropped() -> None:
    estimates = [
        episode(0, (1, 0, 0), 0, reads=3),
        episode(0, (2, 0, 1), 10, reads=12),
        episode(0, (2.1, 0, 0), 20),
    ]
    assert estimates_of_one_hinge(estimates, np.zeros((1, 3))) == estimates[1:]


def test_poses_follow_their_key_scans() -> None:
    path = np.array([[0.0, 0, 0], [1.0, 2.0, np.pi / 2]])
    placed = episode(1, (1, 0, 0), 0).pose_in_map(path)
    np.testing.assert_allclose(placed, [1.0, 3.0, np.pi / 2], atol=1e-12)
    wide = replace(episode(1, (1, 0, 0), 0), covariance=np.diag([4.0, 1.0, 0.1]))
    np.testing.assert_allclose(np.diag(wide.covariance_in_map(path)), [1.0, 4.0, 0.1])


def test_the_own_pose_of_a_door_accounts_for_its_hinge() -> None:
    door = model_of((0.9, 0.0))
    np.testing.assert_allclose(door.footprint[:, 0], [-0.9, 0.0, 0.0, -0.9])
    np.testing.assert_allclose(door.own_pose(np.array([5.0, 5.0, np.pi / 2])), [5.0, 4.1, np.pi / 2])


@pytest.mark.parametrize("is_door", [False, True])
def test_objects_found_again_correct_the_path(is_door: bool) -> None:
    truth = np.array([[0.0, 0, 0], [0.0, 0.5, 3.0]])
    object_pose = np.array([2.0, 1.0, 0.3])
    estimates = [
        ObjectEpisode(k, se2.between(truth[k], object_pose), 1e-6 * np.eye(3), k, k, 5, 9.0) for k in (0, 1)
    ]
    other = [
        ObjectEpisode(k, se2.between(truth[k], [1.0, -2.0, 0.0]), 1e-6 * np.eye(3), k, k, 5, 9.0)
        for k in (0, 1)
    ]
    drifted = truth + np.array([[0, 0, 0], [0.15, -0.1, 0.03]])
    hinge = (0.0, 0.0) if is_door else None
    objects = [ObjectHistory(model_of(hinge), s[-1:], s) for s in (estimates, other)]
    edges = landmark_edges(objects, drifted)
    found, _ = optimise(drifted, edges, 5.0)
    relative = se2.between(found[0], found[1])
    np.testing.assert_allclose(relative, se2.between(truth[0], truth[1]), atol=5e-3)


def test_a_path_on_which_an_object_stands_still_weighs_more_but_a_move_is_possible() -> None:
    pair = Reobservation(episode(0, (1, 0, 0), 0), episode(1, (1, 0, 0), 10), is_door=False)
    paths = np.zeros((3, 2, 3))
    paths[1, 1, 0], paths[2, 1, 0] = 0.02, 5.0
    right, off, lost = log_object_weights([pair], paths, 0.02)
    assert right > off > lost
    assert lost == pytest.approx(np.log(0.02))


def test_objects_are_drawn_into_the_composed_map_even_outside_of_it() -> None:
    static = OccupancyGrid(np.zeros((10, 10), np.float32), GridGeometry(0.1, (0.0, 0.0)))
    square = np.array([[0.3, 0.3], [0.6, 0.3], [0.6, 0.6], [0.3, 0.6]])
    composed = compose_map(static, [square, square - 0.8])
    assert not np.any(static.probability)
    row, col = composed.geometry.cells(np.array([[0.45, 0.45], [-0.35, -0.35], [0.85, 0.85]])).T
    np.testing.assert_allclose(composed.probability[row, col], [0.97, 0.97, 0.0])
    assert compose_map(static, []) is static


def test_points_on_and_near_a_footprint_belong_to_the_object() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.array([[0.5, 0.5], [1.04, 0.5], [1.07, 0.5], [3.0, 3.0]])
    assert points_on(points, [square], 0.05).tolist() == [True, True, False, False]
    assert not points_on(points, [], 0.05).any()
