"""A drive through a corridor by seed, with what its cameras detect instead of their images.

A camera sees the sides of robot and people that face it. People hide what is behind them up to the length of their shadow. A
part of the detections is missed, and some frames have one where nothing moves.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import DepthImage, Event, Image, Odometry, readonly
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.sensors.fixed_camera import FloorDetections
from gridslam.sensors.floor_cells import FloorCells
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import WorldConfig
from tests.benchmarks.ispace_corridors import is_in_view

Floats = NDArray[np.float64]

FRAME_EVERY, CELL_M = 5, 0.1  # of the true poses, which come ten times a second; size of a floor cell
WARM_UP = 25  # true poses until the cameras know their backgrounds
# Fractions of the objects in view that are missed, and of the frames with a false detection
MISSED, FALSE = 0.1, 0.02
ROBOT_RADIUS_M, PERSON_RADIUS_M = 0.25, 0.22
ROBOT_M2, PERSON_M2 = 0.2, 0.6  # surface that is seen of them
# Length of a person's shadow under a camera, and its growth with the distance
SHADOW_M, SHADOW_PER_M = 0.5, 2.0
HIDES_WITHIN_M = 10.0  # a person farther from a camera hides nothing in its view
SIDE_POINTS, POINT_STD_M = 12, 0.03


@dataclass(frozen=True, slots=True)
class SeenDrive:
    """Messages, true poses, map and cameras (by frame) of a drive."""

    events: list[Event]
    truth: Trajectory
    grid: OccupancyGrid
    cameras: dict[str, SeeingCamera]


@dataclass
class SeeingCamera:
    """Stands in for a camera with a background model: the pixels of its images are the number of the frame."""

    true_coverage: FloorCells
    place: Floats
    error: Floats = field(default_factory=lambda: np.zeros(3))  # pose by which its extrinsics are given wrong
    frames: list[FloorDetections] = field(default_factory=list)
    bumped_at: int | None = None  # frame from which on `bump` is its error
    bump: Floats = field(default_factory=lambda: np.zeros(3))
    is_moved: bool = False
    _correction: Floats = field(default_factory=lambda: np.zeros(3))

    @property
    def coverage(self) -> FloorCells:
        """The cells that it covers, by its extrinsics."""
        if not (self.error.any() or self._correction.any()):
            return self.true_coverage
        return FloorCells.containing(self._placed(self.true_coverage.centres, self.error), CELL_M)

    def correct(self, pose: Floats) -> None:
        """Take the camera as moved by a pose `(3,)` from where its extrinsics have it."""
        self._correction = pose

    def detect(self, pixels: NDArray[np.uint8], depth_m: NDArray[np.float32]) -> FloorDetections:
        """The detections of the frame whose number the pixels are."""
        number = int(pixels.view(np.int32)[0, 0])
        is_bumped = self.bumped_at is not None and number >= self.bumped_at
        seen = self.frames[number]
        return replace(seen, points=self._placed(seen.points, self.bump if is_bumped else self.error))

    def floor_error(self, position: Floats, error: Floats) -> tuple[float, float]:
        """How far a position `(2,)` on the floor is placed off (m) by the given extrinsics, and by the corrected ones."""
        given = se2.transform_points(se2.inverse(error), position[None])[0]
        corrected = self._placed(position[None], error)[0]
        return float(np.hypot(*(given - position))), float(np.hypot(*(corrected - position)))

    def _placed(self, points: Floats, error: Floats) -> Floats:
        return se2.transform_points(se2.compose(self._correction, se2.inverse(error)), points)


def drive_through(world: WorldConfig) -> SeenDrive:
    """The drive through a corridor."""
    simulator = Simulator(world.model_copy(update={"fixed_cameras": ()}), Path())
    grid, scene = true_map(simulator.scene, world.truth), simulator.scene
    rng = np.random.default_rng([world.seed, 5])
    floor = FloorCells.containing(grid.geometry.centres(np.argwhere(grid.probability < 0.3)), CELL_M).unique()
    covers = is_in_view(world, floor.centres)
    names = [camera.name for camera in world.fixed_cameras]
    places = np.array([(c.extrinsics.x, c.extrinsics.y) for c in world.fixed_cameras])
    cameras = {
        name: SeeingCamera(floor.select(seen), place)
        for name, seen, place in zip(names, covers, places, strict=True)
    }
    events: list[Event] = []
    truth: list[Odometry] = []
    for event, is_truth in drive_route(simulator):
        if not is_truth:
            events.append(event)
            continue
        assert isinstance(event, Odometry)
        truth.append(event)
        people = [walker.pose(simulator.time_s)[:2] for walker in scene.walkers]
        objects = np.array([(event.x_m, event.y_m), *people])
        for k, name in enumerate(names):
            if len(truth) > WARM_UP and (len(truth) + k) % FRAME_EVERY == 0:
                events += frame(cameras[name], name, event.stamp_ns)
                cameras[name].frames.append(seen_by(cameras[name].true_coverage, places[k], objects, rng))
    stamps = np.array([pose.stamp_ns for pose in truth], np.int64)
    poses = np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in truth])
    return SeenDrive(events, Trajectory(stamps, poses), grid, cameras)


def frame(camera: SeeingCamera, name: str, stamp_ns: int) -> list[Event]:
    """The messages of a camera's next frame."""
    number = np.array([[len(camera.frames)]], np.int32).view(np.uint8)
    depth = readonly(np.ones(number.shape, np.float32), np.float32)
    return [Image(stamp_ns, name, readonly(number, np.uint8)), DepthImage(stamp_ns, name, depth)]


def seen_by(
    coverage: FloorCells, place: Floats, objects: Floats, rng: np.random.Generator
) -> FloorDetections:
    """What a camera at a place `(2,)` detects of the robot and the people at `(n, 2)`, the robot first."""
    centres = coverage.centres
    people = [p for p in objects[1:] if np.hypot(*(p - place)) < HIDES_WITHIN_M]
    hides = np.zeros(len(centres), np.bool_)
    for person in people:
        hides |= in_shadow(place, person, centres)
    points, areas = [np.zeros((0, 2))], [np.zeros(0)]
    for centre, is_robot in [(objects[0], True), *((person, False) for person in people)]:
        others = [other for other in people if other is not centre]
        is_covered = np.abs(centres - centre).max(axis=1, initial=0.0).min(initial=np.inf) < CELL_M
        hidden = is_covered and any(in_shadow(place, other, centre[None])[0] for other in others)
        if not is_covered or hidden or rng.random() < MISSED:
            continue
        points.append(side_of(centre, place, ROBOT_RADIUS_M if is_robot else PERSON_RADIUS_M, rng))
        areas.append(np.full(SIDE_POINTS, (ROBOT_M2 if is_robot else PERSON_M2) / SIDE_POINTS))
    if rng.random() < FALSE and len(centres):
        points.append(side_of(centres[rng.integers(len(centres))], place, 0.1, rng))
        areas.append(np.full(SIDE_POINTS, ROBOT_M2 / SIDE_POINTS))
    return FloorDetections(np.concatenate(points), np.concatenate(areas), ~hides)


def in_shadow(place: Floats, person: Floats, positions: Floats) -> NDArray[np.bool_]:
    """Which of the positions `(n, 2)` a person hides from a camera at a place."""
    to_person = person - place
    distance = float(np.hypot(*to_person))
    along = (positions - place) @ to_person / distance
    aside = np.abs((positions - place) @ np.array([-to_person[1], to_person[0]])) / distance
    behind = along - distance
    is_behind = (behind > PERSON_RADIUS_M) & (behind < SHADOW_M + SHADOW_PER_M * distance)
    return np.asarray(is_behind & (aside < PERSON_RADIUS_M * along / distance))


def side_of(centre: Floats, place: Floats, radius_m: float, rng: np.random.Generator) -> Floats:
    """Points `(SIDE_POINTS, 2)` on the side of a round object that faces a camera."""
    facing = np.arctan2(*(place - centre)[::-1])
    angles = facing + np.linspace(-1.2, 1.2, SIDE_POINTS)
    side = centre + radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.asarray(side + rng.normal(0.0, POINT_STD_M, side.shape) + rng.normal(0.0, POINT_STD_M, 2))
