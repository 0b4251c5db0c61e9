"""Rendered pictures obey the calibration that comes with them; depth errs as the world file says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core.messages import CameraInfo, DepthImage, Event, Image, StereoPair, Transform
from gridslam.simulation.simulator import Simulator
from tests.simulation.places import recorded, room

pytest.importorskip("embreex", reason="cameras need the extra sim")

EXACT: dict[str, Any] = {
    "name": "cam", "kind": "rgbd", "rate_hz": 100.0, "width_px": 96, "height_px": 64, "focal_px": 70.0,
    "extrinsics": {"x": 0.1, "y": 0.05, "z": 0.7, "yaw_deg": 20, "pitch_deg": 15}, "depth_noise_m": 0, "depth_noise_per_m2": 0,
    "depth_resolution_m": 0, "holes": 0, "grazing_deg": 90, "edge_shadow": False, "depth_max_m": 50, "depth_min_m": 0.01,
}  # fmt: skip


def camera(**changes: Any) -> dict[str, Any]:
    return {"cameras": [{**EXACT, **changes}], "odometry": None}


def first(events: list[Event], kind: type) -> Any:
    return next(event for event in events if isinstance(event, kind))


def rotation_of(transform: Transform) -> np.ndarray:
    w, x, y, z = transform.quat_wxyz
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_every_depth_pixel_lies_on_a_surface_by_calibration_and_extrinsics() -> None:
    simulator = Simulator(room(sensors=camera()), Path())
    sensor_extrinsics = first(list(simulator.extrinsics()), Transform)
    events = simulator.step(0.0, 0.0)
    depth, info = first(events, DepthImage).depth_m.astype(float), first(events, CameraInfo)
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    rays = np.stack([u, v, np.ones_like(u)]).reshape(3, -1)
    points = rotation_of(sensor_extrinsics) @ (np.linalg.inv(info.K) @ rays * depth.ravel())
    x, y, z = points + np.reshape(sensor_extrinsics.translation_m, (3, 1)) + np.array([[3.0], [2.0], [0.0]])
    nearest = np.min(np.abs([x - 8, x, y - 5, y, z, z - 2.6]), axis=0)
    assert nearest.max() < 1e-4
    assert (np.abs(z) < 1e-4).sum() > 500
    assert (np.abs(x - 8) < 1e-4).sum() > 500


def test_depth_noise_grows_with_the_square_of_the_range() -> None:
    level = {"extrinsics": {"z": 1.0}}
    exact = first(recorded(room(sensors=camera(**level)), 1), DepthImage).depth_m.astype(float)
    noisy = {**level, "depth_noise_m": 0.003, "depth_noise_per_m2": 0.002, "depth_offset_m": 0.04}
    events = recorded(room(sensors=camera(**noisy)), 40)
    errors = np.array([e.depth_m for e in events if isinstance(e, DepthImage)]) - exact - 0.04
    scaled = errors / (0.003 + 0.002 * exact**2)
    n = scaled.size
    assert abs(scaled.mean()) < 4 / np.sqrt(n)
    assert scaled.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * n))


def test_the_fraction_of_holes_is_that_of_the_world_file() -> None:
    events = recorded(room(sensors=camera(holes=0.07)), 20)
    fraction = np.isnan([e.depth_m for e in events if isinstance(e, DepthImage)])
    assert abs(fraction.mean() - 0.07) < 4 * np.sqrt(0.07 * 0.93 / fraction.size)


def test_there_is_no_depth_outside_the_range_at_grazing_angles_and_in_the_shadow_of_edges() -> None:
    exact = first(recorded(room(sensors=camera()), 1), DepthImage).depth_m
    limited = first(recorded(room(sensors=camera(depth_min_m=2.0, depth_max_m=4.0)), 1), DepthImage).depth_m
    assert np.array_equal(np.isnan(limited), (exact < 2.0) | (exact > 4.0))
    assert (
        np.isnan(first(recorded(room(sensors=camera(grazing_deg=60)), 1), DepthImage).depth_m).mean() > 0.05
    )
    box = [{"centre": [5, 2.8], "size": [0.4, 0.4]}]
    with_box = first(recorded(room(boxes=box, sensors=camera(edge_shadow=True)), 1), DepthImage).depth_m
    assert 10 < np.isnan(with_box).sum() < 100


def test_the_right_picture_of_a_wall_is_the_left_one_shifted_by_the_disparity() -> None:
    stereo = {
        "name": "stereo", "kind": "stereo", "rate_hz": 100.0, "width_px": 128, "height_px": 64, "focal_px": 200.0,
        "extrinsics": {"z": 1.2}, "baseline_m": 0.25, "noise_levels": 0.0,
    }  # fmt: skip
    # The wall is 5 m ahead: 200 * 0.25 / 5 = 10 px
    world = room(sensors={"cameras": [stereo], "odometry": None})
    pair = first(recorded(world, 1), StereoPair)
    left, right = pair.left.astype(int), pair.right.astype(int)
    assert left.std() > 5.0
    assert np.abs(left[:, 10:] - right[:, :-10]).max() <= 2
    infos = [event for event in recorded(world, 1) if isinstance(event, CameraInfo)]
    assert [info.P[0, 3] for info in infos] == pytest.approx([0.0, -200.0 * 0.25])
    assert [info.camera for info in infos] == ["stereo/left", "stereo/right"]


def test_pixel_noise_is_that_of_the_world_file() -> None:
    def pictures(noise_levels: float) -> np.ndarray:
        events = recorded(room(sensors=camera(noise_levels=noise_levels)), 10)
        return np.array([e.pixels for e in events if isinstance(e, Image)]).astype(float)

    clean = pictures(0.0)[0]
    inside = (clean > 20) & (clean < 235)
    errors = (pictures(3.0) - clean)[:, inside]
    assert abs(errors.mean()) < 0.02
    assert errors.std() == pytest.approx(np.sqrt(9.0 + 1 / 6), rel=0.02)  # and rounding, once in each picture


def test_a_fixed_camera_sees_people_and_the_robot() -> None:
    fixed = {**EXACT, "extrinsics": {"x": 0.1, "y": 2.0, "z": 2.2, "pitch_deg": 30}}
    person = {"path": [[3, 3.2], [3, 3.3]], "starts_at_s": 100.0}

    def depth(**changes: Any) -> np.ndarray:
        world = room(fixed_cameras=[fixed], sensors={"odometry": None}, **changes)
        return np.asarray(first(recorded(world, 1), DepthImage).depth_m)

    far_away = {"robot": {"start": [100, 100, 0], "wait_at_start_s": 1e6}}
    empty, with_robot = depth(**far_away), depth()
    with_person = depth(people=[person], **far_away)
    assert 20 < (np.abs(with_robot - empty) > 0.05).sum() < 2000
    assert 50 < (np.abs(with_person - empty) > 0.05).sum() < 3000


def test_the_same_seed_renders_the_same_pixels() -> None:
    one, other = (first(recorded(room(sensors=camera()), 2), Image).pixels for _ in range(2))
    assert np.array_equal(one, other)
