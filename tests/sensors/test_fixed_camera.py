"""A fixed camera in a simulated room: floor positions of moving objects, coverage, and frames that cannot be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.messages import CameraInfo, DepthImage, Image, Transform
from gridslam.sensors.fixed_camera import (
    COLOUR_AND_DEPTH,
    FixedCamera,
    FloorDetections,
    FrameSkip,
)
from gridslam.sensors.floor_cells import FloorCells
from gridslam.sensors.pinhole import Pinhole
from gridslam.simulation.simulator import Simulator
from tests.simulation.places import room

pytest.importorskip("embreex", reason="cameras need the extra sim")

CAMERA: dict[str, Any] = {
    "name": "eye", "kind": "rgbd", "rate_hz": 2.0, "width_px": 160, "height_px": 120, "focal_px": 110.0, "depth_max_m": 10,
    "extrinsics": {"x": 0.2, "y": 2.5, "z": 2.4, "pitch_deg": 28}, "noise_levels": 1.0, "depth_noise_per_m2": 0.0015,
}  # fmt: skip
PARAMETERS = replace(COLOUR_AND_DEPTH, stride_px=1)
FLOOR = FloorCells(np.argwhere(np.ones((80, 50))), 0.1)

Frames = list[tuple[np.ndarray, np.ndarray]]


def filmed(
    seconds: float, turned: Mapping[str, float] | None = None, **changes: Any
) -> tuple[FixedCamera, Frames]:
    """The camera, without a background, and its frames in a room of 8 x 5 m in which only the given people move."""
    moved = {**CAMERA, "extrinsics": {**CAMERA["extrinsics"], **(turned or {})}}
    world = room(fixed_cameras=[moved], robot={"start": [7.5, 0.5, 0], "wait_at_start_s": 1e6}, **changes)
    simulator = Simulator(world, Path())
    sensor_extrinsics = next(
        m for m in simulator.extrinsics() if isinstance(m, Transform) and m.frame_id == "map"
    )
    events = [e for _ in range(int(seconds * 100)) for e in simulator.step(0.0, 0.0)]
    info = next(e for e in events if isinstance(e, CameraInfo))
    images = [e.pixels for e in events if isinstance(e, Image)]
    depths = [e.depth_m for e in events if isinstance(e, DepthImage)]
    return FixedCamera(Pinhole.of(info, sensor_extrinsics), PARAMETERS, FLOOR), list(
        zip(images, depths, strict=True)
    )


def walker(*path: tuple[float, float]) -> dict[str, Any]:
    return {"path": list(path), "speed_mps": 1.0, "starts_at_s": 5.0, "colour": [170, 60, 60]}


def test_frames_of_the_warm_up_are_skipped() -> None:
    camera, frames = filmed(4.0)
    found = [camera.detect(*frame) for frame in frames]
    assert found[:5] == [FrameSkip.WARM_UP] * 5
    assert all(isinstance(s, FloorDetections) and len(s.points) == 0 for s in found[5:])


def test_a_walking_person_is_detected() -> None:
    camera, frames = filmed(8.0, people=[walker((3.0, 1.0), (3.0, 4.5))])
    last = [camera.detect(*frame) for frame in frames][-3:]
    assert all(isinstance(s, FloorDetections) for s in last)
    middles = np.array([np.median(s.points, axis=0) for s in last if isinstance(s, FloorDetections)])
    assert np.abs(middles[:, 0] - 3.0).max() < 0.3
    assert np.diff(middles[:, 1]) == pytest.approx([0.5, 0.5], abs=0.25)  # half a second apart


def test_the_coverage_is_the_floor_in_view() -> None:
    camera, frames = filmed(4.0)
    for frame in frames:
        camera.detect(*frame)
    pixels, depths = camera.pinhole.to_pixels(np.column_stack([FLOOR.centres, np.full(len(FLOOR), 0.35)]))
    in_view = (pixels > -0.5).all(axis=1) & (pixels < [119.5, 159.5]).all(axis=1) & (depths > 0)
    covered = {tuple(c) for c in np.round(camera.coverage.centres, 3).tolist()}
    expected = {tuple(c) for c in np.round(FLOOR.centres[in_view], 3).tolist()}
    assert len(covered ^ expected) < 0.03 * len(expected)


def test_the_floor_behind_a_wall_is_not_covered() -> None:
    camera, frames = filmed(4.0, walls=[{"rectangle": [0, 0, 8, 5]}, {"points": [[4, 0], [4, 5]]}])
    for frame in frames:
        camera.detect(*frame)
    assert len(camera.coverage) > 100
    assert camera.coverage.centres[:, 0].max() < 4.2


def test_after_a_light_is_switched_on_the_background_is_learned_again() -> None:
    camera, frames = filmed(12.0)
    found = []
    for k, (pixels, depth) in enumerate(frames):
        lit = np.clip(pixels.astype(np.int16) + (60 if k >= 10 else 0), 0, 255).astype(np.uint8)
        found.append(camera.detect(lit, depth))
    assert found[10] == FrameSkip.LIGHT_CHANGED
    assert found[11:16] == [FrameSkip.WARM_UP] * 5
    assert all(isinstance(s, FloorDetections) and len(s.points) == 0 for s in found[16:])


def test_a_person_in_the_first_frames_does_not_make_the_camera_moved() -> None:
    camera, frames = filmed(12.0, people=[walker((1.6, 2.4), (7.0, 2.4))])
    found = [camera.detect(*frame) for frame in frames]
    assert all(isinstance(s, FloorDetections) for s in found[5:])
    assert not camera.is_moved


@pytest.mark.parametrize(
    "change", [{"yaw_deg": 10}, {"yaw_deg": 1.5}, {"pitch_deg": 20}, {"y": 2.6}, {"x": 0.3}]
)
def test_a_camera_that_was_moved_is_not_used_any_more(change: dict[str, float]) -> None:
    camera, frames = filmed(5.0)
    _, others = filmed(10.0, turned=change)
    for frame in frames:
        camera.detect(*frame)
    assert not camera.is_moved
    found = [camera.detect(*frame) for frame in others]
    assert all(isinstance(s, FrameSkip) for s in found)
    assert found[-1] == FrameSkip.CAMERA_MOVED
    assert camera.is_moved
    assert camera.detect(*frames[0]) == FrameSkip.CAMERA_MOVED


def last_points(
    camera: FixedCamera, frames: Frames, has_colours: bool = True, has_depths: bool = True
) -> np.ndarray:
    """The moving points `(n, 2)` of the last frame, by colours, by depths, or by both."""
    found = [camera.detect(c if has_colours else None, d if has_depths else None) for c, d in frames]
    assert isinstance(found[-1], FloorDetections)
    return found[-1].points


@pytest.mark.parametrize(("has_colours", "has_depths"), [(True, False), (False, True)])
def test_a_person_is_detected_by_colours_or_by_depths_alone(has_colours: bool, has_depths: bool) -> None:
    both, frames = filmed(8.0, people=[walker((3.0, 1.0), (3.0, 4.5))])
    alone = FixedCamera(both.pinhole, PARAMETERS, FLOOR)
    person = np.median(last_points(both, frames), axis=0)
    off = np.hypot(*(last_points(alone, frames, has_colours, has_depths) - person).T)
    # By colours, the place where the person stood while the background was learned is an object too.
    assert (off < 0.4).mean() > (0.3 if has_colours else 0.95)
    assert ((off < 0.4) | (off > 1.0)).mean() > 0.9
    same = {tuple(c) for c in both.coverage.index.tolist()} ^ {
        tuple(c) for c in alone.coverage.index.tolist()
    }
    assert len(same) < 0.1 * len(both.coverage)


def test_a_corrected_camera_detects_where_the_right_one_does() -> None:
    right, frames = filmed(8.0, people=[walker((3.0, 1.0), (3.0, 4.5))])
    pose = np.array([0.1, -0.05, 0.04])
    wrong = FixedCamera(right.pinhole.moved(se2.inverse(pose)), PARAMETERS, FLOOR)
    known = np.median(last_points(right, frames), axis=0)
    assert np.hypot(*(np.median(last_points(wrong, frames), axis=0) - known)) > 0.05
    wrong.correct(pose)
    again, known = (np.median(last_points(c, frames[-1:]), axis=0) for c in (wrong, right))
    assert again == pytest.approx(known, abs=1e-9)
