"""Places made by seed: the same seed makes the same place, the robot has room, drift and travel are as promised."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.messages import LaserScan, Odometry
from gridslam.core.random import random_stream
from gridslam.simulation.driving.robot_config import route_length_m
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.places.build import place_document
from gridslam.simulation.places.config import Kind
from gridslam.simulation.places.corridors import corridors
from gridslam.simulation.places.vehicle import drift_of
from gridslam.simulation.scene import Scene
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import WorldConfig, load_world, validate_world
from tests.simulation.places import driven

KINDS: tuple[Kind, ...] = get_args(Kind)
Floats = NDArray[np.float64]


def place(kind: Kind, seed: int, travel_m: float = 1000.0) -> WorldConfig:
    return validate_world(place_document(kind, seed, travel_m), "place")


@pytest.mark.parametrize("kind", KINDS)
def test_a_place_depends_on_its_seed_and_on_nothing_else(kind: Kind) -> None:
    assert place_document(kind, 3, 500.0) == place_document(kind, 3, 500.0)
    assert place_document(kind, 3, 500.0)["walls"] != place_document(kind, 4, 500.0)["walls"]
    assert place_document(kind, 3, 500.0)["walls"] == place_document(kind, 3, 4000.0)["walls"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("travel_m", [100.0, 500.0, 2000.0])
def test_the_route_is_as_long_as_asked_and_ends_where_it_begins(kind: Kind, travel_m: float) -> None:
    for seed in range(10):
        robot = place(kind, seed, travel_m).robot
        assert route_length_m(robot) == pytest.approx(travel_m, rel=0.03, abs=6.0)
        assert robot.route[-1] == pytest.approx(robot.start[:2])


@pytest.mark.parametrize("kind", KINDS)
def test_the_route_keeps_clear_of_walls_by_a_hand(kind: Kind) -> None:
    for seed in range(4):
        world = place(kind, seed, 500.0)
        nearest = clearance(world, Scene(world, Path()).static_segments)
        assert nearest > world.robot.radius_m + 0.1, f"seed {seed}"


@pytest.mark.parametrize("kind", KINDS)
def test_odometry_drifts_by_two_to_five_percent(kind: Kind) -> None:
    document = place_document(kind, 1, 1500.0)
    document["sensors"]["lidar"] = None
    drift = odometry_drift(validate_world(document, "place"))
    assert 0.02 <= drift <= 0.05


def test_a_bay_of_a_corridor_looks_like_the_next_one() -> None:
    for seed in range(3):
        layout = corridors(random_stream(seed, "place corridors"))
        walls = [{"points": w.corners.tolist(), "closed": w.closed} for w in layout.walls]
        scene = Scene(validate_world({"walls": walls, "robot": {"start": [0, 0, 0]}}, "corridors"), Path())
        x = np.arange(10.0, 80.0, 1.3)
        here = ranges_along(scene, x)
        pitches = np.arange(2.4, 4.5, 0.02)
        alike = [alikeness(here, ranges_along(scene, x + pitch)) for pitch in pitches]
        assert max(alike) > 0.9
        half_a_bay = 0.5 * pitches[int(np.argmax(alike))]
        assert alikeness(here, ranges_along(scene, x + half_a_bay)) < 0.85


def test_keys_of_the_file_win_over_those_of_the_place() -> None:
    world, _ = load_world("place-office", ["robot.speed_mps=0.5", "place.travel_m=300"], seed=6)
    assert world.robot.speed_mps == 0.5
    assert world.seed == 6
    assert route_length_m(world.robot) == pytest.approx(300.0, rel=0.03)
    assert world.walls == place("office", 6).walls


def test_a_wrong_key_of_a_place_is_an_error_with_its_path() -> None:
    with pytest.raises(ConfigError, match=r"place\.kind"):
        load_world("place-office", ["place.kind=castle"])
    with pytest.raises(ConfigError, match=r"place\.travel: no such key.*'travel_m'"):
        load_world("place-office", ["place.travel=3"])


def test_scans_of_a_place_lose_readings_and_hold_wild_ones() -> None:
    world, _ = load_world("place-corridors", ["place.travel_m=100", "sensors.lidar.stray=0.004"], seed=2)
    simulator, events = driven(world)
    scans = [event for event in events if isinstance(event, LaserScan)]
    lost = np.mean([~np.isfinite(scan.ranges_m) for scan in scans])
    assert 0.003 < lost < 0.5
    assert simulator.robot.distance_m == pytest.approx(100.0, rel=0.1)


def test_wheels_that_spin_yaw_the_robot_and_are_rare() -> None:
    changes = {"per_km": 100.0, "both_wheels_m": 0.3, "one_wheel_m": 0.05}
    travels = []
    for losses in (None, changes):
        document = place_document("corridors", 3, 300.0)
        document["sensors"] = {}
        document["robot"] |= {"wheels": {"grip_losses": losses}, "route": [], "path": [straight(100.0)]}
        simulator, _ = driven(validate_world(document, "place"))
        travels.append((simulator.robot.distance_m, abs(simulator.robot.yaw)))
    assert 0.2 < travels[0][0] - travels[1][0] < 2.0


def straight(distance_m: float) -> dict[str, float]:
    return {"seconds": distance_m, "forward_mps": 1.0}


def clearance(world: WorldConfig, walls: Floats) -> float:
    """Least distance (m) between points of the route, half a metre apart, and walls `(n, 4)`."""
    corners = np.array([world.robot.start[:2], *world.robot.route])
    points = np.concatenate(
        [np.linspace(a, b, int(np.hypot(*(b - a)) / 0.5) + 2) for a, b in pairwise(corners)]
    )
    start, span = walls[:, :2], walls[:, 2:] - walls[:, :2]
    square = np.maximum((span**2).sum(axis=1), 1e-12)
    nearest = np.inf
    for part in np.array_split(points, len(points) // 200 + 1):
        offset = part[:, None] - start
        along = np.clip((offset * span).sum(axis=2) / square, 0.0, 1.0)
        away = offset - along[..., None] * span
        nearest = min(nearest, float(np.hypot(away[..., 0], away[..., 1]).min()))
    return nearest


def alikeness(first: Floats, second: Floats) -> float:
    """Fraction of equal readings in two scans of `(n, 360)`, the median of all scans."""
    return float(np.median((np.abs(first - second) < 0.03).mean(axis=1)))


def ranges_along(scene: Scene, x: Floats) -> Floats:
    """Ranges `(n, 360)` up to 8 m from points on the first corridor's centre line."""
    angles = np.arange(360) * (2.0 * np.pi / 360)
    rays = [np.column_stack([np.tile([v, 0.0], (360, 1)), np.cos(angles), np.sin(angles)]) for v in x]
    return scene.cast(np.concatenate(rays), 8.0, 0.0).ranges_m.reshape(len(x), 360)


def odometry_drift(world: WorldConfig, stretch_m: float = 100.0) -> float:
    """Mean error of odometry over all stretches of the path, as a fraction of their length."""
    odometry, truth = [], []
    for event, is_truth in drive_route(Simulator(world, Path())):
        if isinstance(event, Odometry):
            (truth if is_truth else odometry).append((event.stamp_ns, event.x_m, event.y_m, event.yaw_rad))
    recorded, true = np.array(odometry), np.array(truth)
    after = np.searchsorted(recorded[:, 0], true[:, 0]).clip(0, len(recorded) - 1)
    estimated, true = recorded[after, 1:], true[:, 1:]
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
    ends = np.searchsorted(travelled, travelled + stretch_m)
    starts = np.flatnonzero(ends < len(travelled))
    ends = ends[starts]
    errors = se2.between(
        se2.between(true[starts], true[ends]), se2.between(estimated[starts], estimated[ends])
    )
    return float(np.hypot(errors[:, 0], errors[:, 1]).mean() / stretch_m)


def test_the_drift_of_a_straight_path_is_that_of_its_integral() -> None:
    route = [(0.0, 0.0), (400.0, 0.0)]
    assert drift_of(route, 0.0, 0.02) == pytest.approx(0.02, rel=1e-3)
    assert drift_of(route, 0.001, 0.0) == pytest.approx(0.001 * 100.0 / 2.0, rel=0.02)
