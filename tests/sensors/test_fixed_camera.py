"""A fixed camera in a simulated room: floor positions of what moves, coverage, and what makes a frame useless."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core.messages import CameraInfo, DepthImage, Image, Transform
from gridslam.sensors.fixed_camera import CameraSettings, FixedCamera, Pinhole, Sighting
from gridslam.simulation.simulator import Simulator
from tests.simulation.places import room

pytest.importorskip("embreex", reason="cameras need the extra sim")

CAMERA: dict[str, Any] = {
    "name": "eye", "kind": "rgbd", "rate_hz": 2.0, "width_px": 160, "height_px": 120, "focal_px": 110.0, "depth_max_m": 10,
    "extrinsics": {"x": 0.2, "y": 2.5, "z": 2.4, "pitch_deg": 28}, "noise_levels": 1.0, "depth_noise_per_m2": 0.0015,
}  # fmt: skip
SETTINGS = CameraSettings(
    history=200, threshold=16.0, opening_px=3, closing_px=5, warm_up=5, low_m=0.1, high_m=2.2, stride_px=1,
    most_foreground=0.4, depth_check=True, margin_m=0.08, margin_share=0.03, moved_share=0.12, moved_frames=3,
    cell_m=0.1, least_area_m2=0.01,
)  # fmt: skip
FLOOR = np.argwhere(np.ones((80, 50))) * 0.1 + 0.05

Frames = list[tuple[np.ndarray, np.ndarray]]


def filmed(
    seconds: float, turned: Mapping[str, float] | None = None, **changes: Any
) -> tuple[FixedCamera, Frames]:
    """The camera, untaught, and its frames in a room of 8 x 5 m in which only the given people move."""
    moved = {**CAMERA, "extrinsics": {**CAMERA["extrinsics"], **(turned or {})}}
    world = room(fixed_cameras=[moved], robot={"start": [7.5, 0.5, 0], "wait_at_start_s": 1e9}, **changes)
    simulator = Simulator(world, Path())
    mount = next(m for m in simulator.extrinsics() if isinstance(m, Transform) and m.frame_id == "map")
    events = [e for _ in range(int(seconds * 100)) for e in simulator.step(0.0, 0.0)]
    info = next(e for e in events if isinstance(e, CameraInfo))
    images = [e.pixels for e in events if isinstance(e, Image)]
    depths = [e.depth_m for e in events if isinstance(e, DepthImage)]
    return FixedCamera(Pinhole.of(info, mount), SETTINGS, FLOOR), list(zip(images, depths, strict=True))


def walker(*path: tuple[float, float]) -> dict[str, Any]:
    return {"path": list(path), "speed_mps": 1.0, "starts_at_s": 5.0, "colour": [170, 60, 60]}


def test_nothing_is_said_while_the_background_is_learned() -> None:
    camera, frames = filmed(4.0)
    said = [camera.look(*frame) for frame in frames]
    assert said[:5] == ["warm_up"] * 5
    assert all(isinstance(s, Sighting) and len(s.points) == 0 for s in said[5:])


def test_a_person_is_seen_where_he_walks() -> None:
    camera, frames = filmed(8.0, people=[walker((3.0, 1.0), (3.0, 4.5))])
    last = [camera.look(*frame) for frame in frames][-3:]
    assert all(isinstance(s, Sighting) for s in last)
    middles = np.array([np.median(s.points, axis=0) for s in last if isinstance(s, Sighting)])
    assert np.abs(middles[:, 0] - 3.0).max() < 0.3
    assert np.diff(middles[:, 1]) == pytest.approx([0.5, 0.5], abs=0.25)  # half a second apart


def test_the_coverage_is_the_floor_in_view() -> None:
    camera, frames = filmed(4.0)
    for frame in frames:
        camera.look(*frame)
    pixels, depths = camera.pinhole.to_pixels(np.column_stack([FLOOR, np.full(len(FLOOR), 0.35)]))
    in_view = (pixels > -0.5).all(axis=1) & (pixels < [119.5, 159.5]).all(axis=1) & (depths > 0)
    seen = {tuple(c) for c in np.round(camera.coverage, 3).tolist()}
    expected = {tuple(c) for c in np.round(FLOOR[in_view], 3).tolist()}
    assert len(seen ^ expected) < 0.03 * len(expected)


def test_behind_a_wall_nothing_is_covered() -> None:
    camera, frames = filmed(4.0, walls=[{"rectangle": [0, 0, 8, 5]}, {"points": [[4, 0], [4, 5]]}])
    for frame in frames:
        camera.look(*frame)
    assert len(camera.coverage) > 100
    assert camera.coverage[:, 0].max() < 4.2


def test_a_light_switched_on_costs_some_frames_and_is_learned() -> None:
    camera, frames = filmed(12.0)
    said = []
    for k, (pixels, depth) in enumerate(frames):
        lit = np.clip(pixels.astype(np.int16) + (60 if k >= 10 else 0), 0, 255).astype(np.uint8)
        said.append(camera.look(lit, depth))
    assert said[10] == "light_changed"
    assert said[11:16] == ["warm_up"] * 5
    assert all(isinstance(s, Sighting) and len(s.points) == 0 for s in said[16:])


def test_who_stood_before_the_camera_when_it_began_to_look_does_not_make_it_moved() -> None:
    camera, frames = filmed(12.0, people=[walker((1.6, 2.4), (7.0, 2.4))])
    said = [camera.look(*frame) for frame in frames]
    assert all(isinstance(s, Sighting) for s in said[5:])
    assert not camera.is_moved


@pytest.mark.parametrize("change", [{"yaw_deg": 10}, {"pitch_deg": 33}, {"pitch_deg": 20}, {"y": 3.3}])
def test_a_camera_that_was_moved_is_not_listened_to_any_more(change: dict[str, float]) -> None:
    camera, frames = filmed(5.0)
    _, others = filmed(10.0, turned=change)
    for frame in frames:
        camera.look(*frame)
    assert not camera.is_moved
    said = [camera.look(*frame) for frame in others]
    assert all(isinstance(s, str) for s in said)
    assert said[0] == "light_changed"
    assert said[-1] == "camera_moved"
    assert camera.is_moved
    assert camera.look(*frames[0]) == "camera_moved"
