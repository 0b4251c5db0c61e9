"""The explorer in a simulated corridor with the true pose in place of an estimate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.base import Estimate
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.exploration_report import exploration_measures, tour_table
from gridslam.methods.handmap_slam.driving.explorer import Explorer
from gridslam.runs.explore import drive_of
from gridslam.simulation.driving.contact import ContactWatch
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import WorldConfig, validate_world

SCALE_X, SCALE_Y = 1.3, 0.9
MARGIN_M = 0.5  # around the hall, drawing units
LENGTH_M, WIDTH_M = 14.0, 6.0


def hall(*walls: list[list[float]], boxes: tuple[tuple[float, float], ...] = ()) -> WorldConfig:
    """A hall with a room behind a wall at x = 9 whose door is at y = 2 .. 3.4; further walls and boxes."""
    return validate_world(
        {
            "seed": 3,
            "walls": [
                {"rectangle": [0, 0, LENGTH_M, WIDTH_M]},
                {"points": [[9, 0], [9, 2]]},
                {"points": [[9, 3.4], [9, 6]]},
                *({"points": points} for points in walls),
            ],
            "boxes": [{"centre": list(c), "size": [0.8, 0.8]} for c in boxes],
            "robot": {"start": [1.5, 3, 0]},
            "sensors": {"lidar": {"rate_hz": 5, "beams": 360, "range_max_m": 30, "noise_m": 0.01}},
        },
        "hall",
    )


def drawing_of_hall(with_room: bool = True) -> DrawnMap:
    """The hall as drawn at other scales along x and y, with or without the room."""
    step = 0.1
    rows = int((WIDTH_M * SCALE_Y + 2 * MARGIN_M) / step)
    cols = int((LENGTH_M * SCALE_X + 2 * MARGIN_M) / step)
    centres = (np.indices((rows, cols)).transpose(1, 2, 0)[..., ::-1] + 0.5) * step - MARGIN_M
    x, y = centres[..., 0] / SCALE_X, centres[..., 1] / SCALE_Y
    walls = ~((x > 0.0) & (x < LENGTH_M) & (y > 0.0) & (y < WIDTH_M))
    walls |= (np.abs(x - 9.0) < 0.06) & ((y < 2.0) | (y > 3.4) | (not with_room))
    free = ~walls if with_room else ~walls & (x < 9.0)
    return DrawnMap(free, walls, "dark", False, GridGeometry(step, (0.0, 0.0)))


@dataclass(frozen=True, slots=True)
class Exploration:
    explorer: Explorer
    simulator: Simulator
    touched: bool


def drive(
    world: WorldConfig, drawn: DrawnMap, config: ExplorationConfig, max_duration_s: float = 150.0
) -> Exploration:
    """The closed loop with the true pose in place of an estimate."""
    simulator = Simulator(world, Path())
    explorer = Explorer(config, drawn, drive_of(world), seed=1)
    watch = ContactWatch(simulator)
    start = simulator.robot.pose.copy()
    for extrinsics in simulator.extrinsics():
        explorer.add(extrinsics)
    estimate = pose = None
    while not explorer.is_finished and simulator.time_s < max_duration_s and not watch.is_touching:
        command = explorer.command(estimate, pose)
        radius = world.robot.wheels.radius_m
        for _ in range(10):
            for event in simulator.step(command.left_mps / radius, command.right_mps / radius):
                explorer.add(event)
        stamp, true = world.start_ns + round(simulator.time_s * 1e9), simulator.robot.pose
        estimate = Estimate(stamp, se2.between(start, true))
        pose = DrawingPose(
            stamp,
            float(true[0]) * SCALE_X + MARGIN_M,
            float(true[1]) * SCALE_Y + MARGIN_M,
            float(se2.wrap_angle(true[2])),
            scale_x=SCALE_X,
            scale_y=SCALE_Y,
            position_std=0.1,
            inlier_ratio=1.0,
        )
    return Exploration(explorer, simulator, watch.is_touching)


TOUR_ONLY = ExplorationConfig(visit_frontiers=False)


def test_the_robot_visits_hall_and_room_and_finishes() -> None:
    driven = drive(hall(), drawing_of_hall(), TOUR_ONLY)
    assert driven.explorer.is_finished
    assert not driven.touched
    measures = exploration_measures(driven.explorer.plan)
    assert measures["unreachable"] == []
    assert float(str(measures["walls_observed"])) > 0.95
    plan = driven.explorer.plan
    assert plan is not None
    rows = tour_table(plan).rows
    assert [row[0] for row in rows] == list(range(1, len(plan.targets) + 1))
    assert {row[3] for row in rows} <= {"reached", "seen"}


def test_the_robot_does_not_touch_boxes_missing_from_the_drawing() -> None:
    driven = drive(hall(boxes=((5.0, 3.0), (3.0, 1.2), (7.4, 4.6))), drawing_of_hall(), TOUR_ONLY)
    assert driven.explorer.is_finished
    assert not driven.touched
    assert exploration_measures(driven.explorer.plan)["unreachable"] == []


def test_a_walled_up_room_is_reported_as_unreachable_and_the_rest_is_visited() -> None:
    driven = drive(hall([[9, 2], [9, 3.4]]), drawing_of_hall(), TOUR_ONLY)
    assert driven.explorer.is_finished
    assert not driven.touched
    plan = driven.explorer.plan
    assert plan is not None
    missed = [t for t in plan.targets if t.status == "unreachable"]
    assert missed
    assert all(t.xy[0] > 9.0 * SCALE_X + MARGIN_M for t in missed)
    assert all("no open path" in t.reason or "obstacle" in t.reason or "closer" in t.reason for t in missed)
    assert all(t.status in ("reached", "seen") for t in plan.targets if t not in missed)


@pytest.mark.parametrize("enabled", [False, True])
def test_a_room_missing_from_the_drawing_is_visited_only_after_the_tour(enabled: bool) -> None:
    config = ExplorationConfig(visit_frontiers=enabled)
    driven = drive(hall(), drawing_of_hall(with_room=False), config)
    assert driven.explorer.is_finished
    assert not driven.touched
    farthest = driven.simulator.robot.poses_at(np.arange(0.0, driven.simulator.time_s, 0.5))[:, 0].max()
    assert (farthest > 8.7) == enabled


def test_the_robot_stands_until_the_estimator_has_a_pose() -> None:
    explorer = Explorer(TOUR_ONLY, drawing_of_hall(), drive_of(hall()), seed=0)
    command = explorer.command(None, None)
    assert (command.left_mps, command.right_mps) == (0.0, 0.0)
    assert not explorer.is_finished
