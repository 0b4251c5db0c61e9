"""A cloud sensor that hangs upside down, or is tilted, is found by the floor that it sees; one that is right stays as it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gridslam.core.messages import PointCloud, Transform, readonly
from gridslam.logs.config import CloudConfig
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.placement.cloud_floor import placed_by_floor
from gridslam.logs.placement.virtual_scan import virtual_lidar

HEIGHT_M = 0.6


def cloud(turned: Rotation, has_floor: bool = True) -> PointCloud:
    """Points of a room of 8 x 6 m, and of its floor, in the frame of a sensor that is turned."""
    rng = np.random.default_rng(3)
    side = rng.integers(0, 4, 4000)
    along, height = rng.uniform(-1.0, 1.0, 4000), rng.uniform(0.1, 1.8, 4000)
    x = np.where(side < 2, np.where(side == 0, 4.0, -4.0), 4.0 * along)
    y = np.where(side < 2, 3.0 * along, np.where(side == 2, 3.0, -3.0))
    walls = np.column_stack([x, y, height])
    floor = np.column_stack([rng.uniform(-3.0, 3.0, (1500, 2)), np.zeros(1500)])
    points = np.concatenate([walls, floor]) if has_floor else walls
    seen = turned.inv().apply(points - [0.0, 0.0, HEIGHT_M]) + rng.normal(0.0, 0.01, (len(points), 3))
    return PointCloud(0, "lidar", readonly(seen, np.float32), readonly(np.zeros(0), np.float32))


LIDAR = virtual_lidar(
    "lidar",
    Transform(0, "base", "lidar", (0.0, 0.0, HEIGHT_M), (1.0, 0.0, 0.0, 0.0), is_static=True),
    CloudConfig(),
)


@pytest.mark.parametrize(
    ("euler_deg", "says"),
    [
        ((180.0, 0.0, 0.0), "lidar hangs upside down by the floor"),
        ((0.0, 10.0, 0.0), "lidar is tilted by 10 deg"),
        ((-15.0, 0.0, 0.0), "lidar is tilted by 15 deg"),
        ((175.0, 0.0, 0.0), "hangs upside down and is tilted by 5 deg"),
    ],
)
def test_the_floor_shows_how_a_sensor_hangs(euler_deg: tuple[float, ...], says: str) -> None:
    turned, counts = Rotation.from_euler("xyz", euler_deg, degrees=True), MessageCounts()
    found = placed_by_floor(LIDAR, [cloud(turned)], counts)
    assert says in counts.problems[0]
    assert counts.has_findings
    assert Rotation.from_matrix(found.rotation @ turned.as_matrix().T).magnitude() < math.radians(1.5)


def test_a_sensor_whose_floor_is_below_it_or_not_seen_is_left_unchanged() -> None:
    counts = MessageCounts()
    for seen in (
        cloud(Rotation.identity()),
        cloud(Rotation.from_euler("x", 180, degrees=True), has_floor=False),
    ):
        assert placed_by_floor(LIDAR, [seen], counts) is LIDAR
    assert placed_by_floor(LIDAR, [], counts) is LIDAR
    assert not counts.problems


@pytest.mark.parametrize("floor_m", [0.0, -0.3])
def test_clouds_in_the_base_frame_have_their_band_above_the_floor_that_they_show(floor_m: float) -> None:
    counts = MessageCounts()
    at_base = Transform(0, "base", "base", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True)
    lidar = virtual_lidar("base", at_base, CloudConfig())
    seen = cloud(Rotation.identity())
    raised = readonly(seen.points_m + np.array([0.0, 0.0, HEIGHT_M + floor_m]), np.float32)
    found = placed_by_floor(lidar, [replace(seen, points_m=raised)], counts)
    assert (found.min_height_m, found.max_height_m) == pytest.approx((floor_m + 0.2, floor_m + 1.8), abs=0.02)
    assert "show the floor" in counts.problems[0]


@pytest.mark.parametrize("slope", [0.0, 0.03])
def test_the_points_of_few_rings_are_no_floor(slope: float) -> None:
    counts = MessageCounts()
    at_base = Transform(0, "base", "base", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True)
    lidar = virtual_lidar("base", at_base, CloudConfig())
    seen = cloud(Rotation.identity(), has_floor=False)
    flat = np.array(seen.points_m)
    flat[:, 2] = slope * np.resize([-3.0, -1.0, 1.0, 3.0], len(flat)) * np.hypot(flat[:, 0], flat[:, 1])
    assert placed_by_floor(lidar, [replace(seen, points_m=readonly(flat, np.float32))], counts) is lidar
    assert not counts.problems


@pytest.mark.parametrize("config", [CloudConfig(), CloudConfig(min_height_m=-0.4)])
def test_a_floor_below_the_band_or_a_band_of_the_config_change_nothing(config: CloudConfig) -> None:
    counts = MessageCounts()
    at_base = Transform(0, "base", "lidar", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True)
    lidar = virtual_lidar("lidar", at_base, config)
    low = cloud(Rotation.identity(), has_floor=config.min_height_m is None)
    assert placed_by_floor(lidar, [low], counts) is lidar
    assert not counts.problems
