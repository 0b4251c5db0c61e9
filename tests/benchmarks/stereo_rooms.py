"""Simulated rooms for a stereo head: disparity images by ray casting into exact geometry, with false matches at any rate.

The images do not follow the model of the estimator: noise common to groups of columns, quantised disparities, false matches over
several groups, holes, and a floor.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import Polygon, box

from gridslam.core import poses as se2
from gridslam.core.cameras import StereoHead
from gridslam.simulation.scene import Scene
from gridslam.simulation.world_config import WorldConfig
from tests.conftest import REPOSITORY

Floats = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX, FOCAL_PX, BASELINE_M = 320, 120, 260.0, 0.12
CAMERA_M = 0.6
GROUP_PX = 4
ROOM_M = (6.0, 5.0)
CELL_M = 0.05
MAX_RANGE_M = 10.0
PIECE_M = 0.3
QUAT = (0.5, -0.5, 0.5, -0.5)  # optical: x right, y down, z ahead


def head() -> StereoHead:
    """The stereo head, at the centre of the robot, facing forward."""
    centre = (0.5 * (WIDTH_PX - 1), 0.5 * (HEIGHT_PX - 1))
    return StereoHead.of_extrinsics(FOCAL_PX, centre, BASELINE_M, QUAT, (0.0, 0.0, CAMERA_M))


@dataclass(frozen=True, slots=True)
class StereoRoom:
    """A room with boxes, and the poses of the frames `(n, 3)`."""

    scene: Scene
    boxes: list[Polygon]
    poses: Floats


def room_of(seed: int, frames: int = 60) -> StereoRoom:
    """A room of 6 x 5 m with four to seven boxes, and a closed route on which the robot faces all sides."""
    rng = np.random.default_rng(seed)
    boxes, documents = [], []
    while len(boxes) < 4 + seed % 4:
        size = rng.uniform(0.25, 0.8, 2)
        centre = rng.uniform(0.5, np.subtract(ROOM_M, 0.5))
        yaw = float(rng.uniform(0.0, 90.0))
        if np.hypot(*((centre - np.multiply(ROOM_M, 0.5)) / (1.7, 1.3))) < 1.0:
            continue  # on the robot's route
        documents.append({"centre": centre.tolist(), "size": size.tolist(), "yaw_deg": yaw, "height_m": 1.2})
        boxes.append(footprint(centre, size, np.radians(yaw)))
    world = WorldConfig.model_validate(
        {
            "walls": [{"rectangle": [0, 0, *ROOM_M]}],
            "boxes": documents,
            "robot": {"start": [3, 2.5, 0], "route": [[3.1, 2.5]]},
        }
    )
    t = np.linspace(0.0, 2.0 * np.pi, frames, endpoint=False)
    x, y = 3.0 + 1.0 * np.cos(t), 2.5 + 0.7 * np.sin(t)
    yaw = t + np.pi / 2 + 1.3 * np.sin(5.0 * t + rng.uniform(0.0, 6.0))
    poses = np.column_stack([x, y, se2.wrap_angle(yaw)])
    return StereoRoom(Scene(world, REPOSITORY), boxes, poses)


def footprint(centre: Floats, size: Floats, yaw: float) -> Polygon:
    """A box on the floor."""
    corners = 0.5 * size * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return Polygon(se2.transform_points(np.array([*centre, yaw]), corners))


def contours_of(room: tuple[float, float, float, float], boxes: Sequence[Polygon]) -> list[Floats]:
    """Points `(8, 2)` of every piece, about 30 cm long, of the contours of a room (x0, y0, x1, y1) and its boxes."""
    pieces = []
    for ring in (box(*room).exterior, *(b.exterior for b in boxes)):
        ends = np.linspace(0.0, ring.length, max(round(ring.length / PIECE_M), 1) + 1)
        for first, last in itertools.pairwise(ends):
            pieces.append(np.array([ring.interpolate(at).coords[0] for at in np.linspace(first, last, 8)]))
    return pieces


def depths_of(room: StereoRoom, pose: Floats) -> Floats:
    """Depth of the first obstacle `(width,)` in each column."""
    x = (np.arange(WIDTH_PX) - 0.5 * (WIDTH_PX - 1)) / FOCAL_PX
    bearings = -np.arctan(x)
    angle = bearings + pose[2]
    rays = np.column_stack([np.tile(pose[:2], (WIDTH_PX, 1)), np.cos(angle), np.sin(angle)])
    return np.asarray(room.scene.cast(rays, 30.0, 0.0).ranges_m * np.cos(bearings))


def disparity_of(
    room: StereoRoom, pose: Floats, false_rate: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """The disparity image from a pose, with false matches in a fraction `false_rate` of the groups of columns."""
    depth = depths_of(room, pose)
    groups = WIDTH_PX // GROUP_PX
    shared = np.repeat(rng.normal(0.0, 0.35, groups), GROUP_PX)
    obstacle = FOCAL_PX * BASELINE_M / depth + shared
    wrong = np.zeros(groups, bool)
    while wrong.mean() < false_rate:
        first = int(rng.integers(groups))
        wrong[first : first + int(rng.integers(1, 4))] = True
    true = np.clip(obstacle[GROUP_PX // 2 :: GROUP_PX], 1.5, 60.0)
    behind = rng.random(groups) < 0.5  # matches behind an edge are as frequent as matches before it
    fake = rng.uniform(np.where(behind, 1.0, true), np.where(behind, true, 64.0))
    obstacle = np.where(np.repeat(wrong, GROUP_PX), np.repeat(fake, GROUP_PX), obstacle)
    rows = (np.arange(HEIGHT_PX) - 0.5 * (HEIGHT_PX - 1)) / FOCAL_PX
    with np.errstate(divide="ignore"):
        floor = np.where(rows > 0.0, rows * FOCAL_PX * BASELINE_M / CAMERA_M, 0.0)
    image = np.maximum(obstacle[None], floor[:, None]) + rng.normal(0.0, 0.25, (HEIGHT_PX, WIDTH_PX))
    lost = np.repeat(rng.random(groups) < 0.03, GROUP_PX)
    image[:, lost] = np.nan
    image[rng.random(image.shape) < 0.1] = np.nan
    return (np.round(image * 16.0) / 16.0).astype(np.float32)


@dataclass(frozen=True, slots=True)
class RoomTruth:
    """Cells `(rows, cols)` of the room with a margin: which are obstacles, and which are visible in some frame."""

    occupied: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    corner: tuple[int, int]  # lattice cell of the first


MARGIN = 4


def truth_of(room: StereoRoom) -> RoomTruth:
    """Obstacles are the cells on a wall or in a box; visible are the cells up to the first obstacle of a ray."""
    cols, rows = (round(length / CELL_M) + 2 * MARGIN for length in ROOM_M)
    tree = STRtree(room.boxes)
    occupied = np.zeros((rows, cols), bool)
    occupied[:MARGIN] = occupied[-MARGIN:] = True
    occupied[:, :MARGIN] = occupied[:, -MARGIN:] = True
    for row in range(MARGIN, rows - MARGIN):
        for col in range(MARGIN, cols - MARGIN):
            x, y = (col - MARGIN) * CELL_M, (row - MARGIN) * CELL_M
            occupied[row, col] = (
                len(tree.query(box(x, y, x + CELL_M, y + CELL_M), predicate="intersects")) > 0
            )
    return RoomTruth(occupied, visible_cells(room, occupied), (-MARGIN, -MARGIN))


def visible_cells(room: StereoRoom, occupied: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Free cells that some ray crosses, and the obstacle cells at the rays' ends."""
    visible = np.zeros(occupied.shape, bool)
    for pose in room.poses:
        depth = depths_of(room, pose)
        x = (np.arange(WIDTH_PX) - 0.5 * (WIDTH_PX - 1)) / FOCAL_PX
        range_m = depth / np.cos(np.arctan(x))
        angle = pose[2] - np.arctan(x)
        for r in np.arange(0.3, MAX_RANGE_M, 0.5 * CELL_M):
            there = range_m + 0.02 > r
            col = np.floor((pose[0] + r * np.cos(angle[there])) / CELL_M).astype(int) + MARGIN
            row = np.floor((pose[1] + r * np.sin(angle[there])) / CELL_M).astype(int) + MARGIN
            inside = (row >= 0) & (col >= 0) & (row < visible.shape[0]) & (col < visible.shape[1])
            visible[row[inside], col[inside]] = True
    return visible
