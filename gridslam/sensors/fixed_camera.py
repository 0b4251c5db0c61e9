"""A fixed RGB-D camera: the floor positions of moving objects, and the floor cells in which they are visible.

These are the dynamic points of ispace-mcl's environment weight (eqs. 5 - 7).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.sensors.background import ColourBackground, Depth, DepthBackground, Mask
from gridslam.sensors.camera_moved import PlacementCheck
from gridslam.sensors.floor_cells import CELLS_AT_ONCE, Floor, FloorCells, visible_from
from gridslam.sensors.pinhole import Pinhole

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DetectionParameters:
    """Parameters of the detection of moving objects in the images of one camera."""

    history: int  # frames that the colour background remembers
    warm_up: int  # first frames, which only teach the background
    uses_depth: bool  # foreground must also lie before the depth background, which removes lights and shadows
    threshold: float = (
        16.0  # squared Mahalanobis distance from which a colour is foreground (MOG2's usual value)
    )
    opening_px: int = 3  # smaller specks of foreground are removed
    closing_px: int = 5  # smaller holes are filled
    min_height_m: float = 0.1  # foreground below is floor
    max_height_m: float = 2.2  # foreground above is a lamp or a sign; people are lower
    stride_px: int = 2  # every stride-th pixel is projected, in rows and columns, for speed
    max_foreground_ratio: float = 0.4  # more foreground than this means that a light was switched
    margin_m: float = 0.08  # depth noise near the camera
    margin_ratio: float = 0.03  # and its growth with the depth, as of structured-light cameras
    cell_m: float = 0.1  # size of a floor cell
    min_area_m2: float = 0.01  # less surface above a floor cell is noise


COLOUR_AND_DEPTH = DetectionParameters(history=200, warm_up=5, uses_depth=True)
# The paper's background subtraction. A robot that stands while the background is learned becomes part of it, and without a check
# by depth it is not detected when it leaves: hence the long warm-up, and the long memory for robots that stand later.
COLOUR_ONLY = DetectionParameters(history=500, warm_up=15, uses_depth=False)

_COVERAGE_MAX_HEIGHT_M = 0.6  # the height of a robot: coverage is that of a point half as high
_OCCLUSION_M = 0.5  # a reading this far before a floor cell hides it
# Fraction of an object's height in the image: in columns where it ends higher than this, it overhangs its feet
_FEET_RATIO = 0.15
MAX_VIEW_M = 50.0  # farthest floor that is looked at on a large map, by colours alone
MAX_FEET_DEPTH_M = 15.0  # farthest feet by colours alone: farther away a pixel is decimetres of floor


class FrameSkip(str, Enum):
    """Reasons why a frame of a fixed camera yields no detections; the values are the counters' names."""

    WARM_UP = "warm_up"
    LIGHT_CHANGED = "light_changed"
    CAMERA_MOVED = "camera_moved"


@dataclass(frozen=True, slots=True)
class FloorDetections:
    """The moving points of one frame: floor positions `(n, 2)`, each with the surface `(n,)` that its pixel covers.

    `is_visible` `(m,)` is True for the cells of the camera's `coverage` that nothing hides in this frame.
    """

    points: Floats
    areas_m2: Floats
    is_visible: NDArray[np.bool_]


@dataclass
class FixedCamera:
    """One camera with its background models and the floor cells that it covers.

    Its frames have colours and depths, or one of the two. By colours alone, an object stands where its lowest pixels meet the
    floor, and walls are where the floor ends.
    """

    pinhole: Pinhole
    parameters: DetectionParameters
    floor: Floor  # where the map is free
    colour: ColourBackground = field(init=False)
    depth: DepthBackground = field(init=False)
    placement: PlacementCheck = field(default_factory=PlacementCheck)
    coverage: FloorCells = field(init=False)  # those that the camera sees when nobody is in the room
    _given: Pinhole = field(init=False)
    _frames: int = 0  # since the background is learned
    _pixels: NDArray[np.int64] = field(init=False)  # (m, 2) image positions of the coverage
    _depths: Floats = field(init=False)

    def __post_init__(self) -> None:
        p = self.parameters
        self.colour = ColourBackground(
            p.history, p.threshold, opening_px=p.opening_px, closing_px=p.closing_px, warm_up=p.warm_up
        )
        self.depth = DepthBackground(p.margin_m, p.margin_ratio)
        self._given = self.pinhole
        self.correct(np.zeros(3))

    @property
    def is_moved(self) -> bool:
        """Whether the camera was moved since the background was learned."""
        return self.placement.is_moved

    @property
    def place(self) -> Floats:
        """Position of the camera `(2,)` on the map by the given extrinsics."""
        return self._given.position[:2]

    def correct(self, pose: Floats) -> None:
        """Take the camera as moved by a pose `(3,)` (m, m, rad) of the map frame from where the given extrinsics have it."""
        self.pinhole = self._given.moved(pose)
        # Found with the next frame.
        self.coverage = FloorCells(np.zeros((0, 2), np.int64), self.parameters.cell_m)

    def detect(self, pixels: NDArray[np.uint8] | None, depth_m: Depth | None) -> FloorDetections | FrameSkip:
        """The moving points of a frame, or the reason why the frame has none.

        `pixels` are `(rows, cols)` grey or `(rows, cols, 3)` RGB, `depth_m` `(rows, cols)`; either may be missing.
        """
        p = self.parameters
        if self.is_moved:
            return FrameSkip.CAMERA_MOVED
        self._frames += 1
        is_learning = self._frames <= p.warm_up
        foreground = changed = self._foreground(pixels, depth_m)
        if pixels is not None and not is_learning and foreground.mean() > p.max_foreground_ratio:
            self.colour.restart()
            self._frames = 0
            return FrameSkip.LIGHT_CHANGED
        if pixels is not None and depth_m is not None and p.uses_depth:
            foreground = changed & self.depth.nearer(depth_m)
        known = not is_learning
        self.placement.add(pixels, depth_m, changed & known, foreground & known)
        if depth_m is not None and not self.placement.differing:
            self.depth.learn(depth_m)
        if is_learning:  # the background is not known well enough to separate people from walls
            return FrameSkip.WARM_UP
        if self.placement.differing:
            return FrameSkip.CAMERA_MOVED
        if not len(self.coverage):
            self._find_coverage(foreground.shape)
        seen = self._feet(foreground) if depth_m is None else self._surfaces(foreground, depth_m)
        return FloorDetections(*seen, self._is_visible(depth_m))

    def _foreground(self, pixels: NDArray[np.uint8] | None, depth_m: Depth | None) -> Mask:
        """Mask `(rows, cols)` of what is not background by its colour or, in a frame without colours, by its depth."""
        if pixels is not None:
            return self.colour.foreground(pixels)
        assert depth_m is not None
        return self.colour.cleaned(self.depth.nearer(depth_m))

    def _surfaces(self, foreground: Mask, depth_m: Depth) -> tuple[Floats, Floats]:
        """Floor positions `(n, 2)` of the foreground pixels within the height band, and the surface `(n,)` of each, m^2."""
        p = self.parameters
        step = p.stride_px
        rows, cols = np.nonzero(foreground[::step, ::step])
        rows, cols = rows * step, cols * step
        depths = depth_m[rows, cols].astype(np.float64)
        known = np.isfinite(depths)
        points = self.pinhole.to_map(rows[known], cols[known], depths[known])
        inside = (points[:, 2] > p.min_height_m) & (points[:, 2] < p.max_height_m)
        return points[inside, :2], depths[known][inside] ** 2 * (step * step / self._focal_px2)

    def _feet(self, foreground: Mask) -> tuple[Floats, Floats]:
        """Floor positions `(n, 2)` of the lowest pixels of each object, by columns, and the surface `(n,)` for each, m^2.

        An object that reaches the image's lower border is left out: its feet are out of view.
        """
        _, labels, boxes, _ = cv2.connectedComponentsWithStats(foreground.astype(np.uint8))
        rows, cols = np.nonzero(foreground)
        member = labels[rows, cols]
        _, lowest, heights = np.unique(
            (member * foreground.shape[1] + cols)[::-1], return_index=True, return_counts=True
        )
        rows, cols, member = rows[::-1][lowest], cols[::-1][lowest], member[::-1][lowest]
        last = boxes[member, cv2.CC_STAT_TOP] + boxes[member, cv2.CC_STAT_HEIGHT] - 1
        depths = self.pinhole.floor_depths(rows, cols)
        are_feet = rows >= last - _FEET_RATIO * boxes[member, cv2.CC_STAT_HEIGHT]
        known = are_feet & (last < len(foreground) - 1) & (depths < MAX_FEET_DEPTH_M)
        points = self.pinhole.to_map(rows[known], cols[known], depths[known])
        return points[:, :2], heights[known] * depths[known] ** 2 / self._focal_px2

    @property
    def _focal_px2(self) -> float:
        return self.pinhole.focal_px[0] * self.pinhole.focal_px[1]

    def _find_coverage(self, shape: tuple[int, ...]) -> None:
        """Find the floor cells above which a point at half a robot's height lies in view and before the background."""
        background = self.depth.depth_m
        height = 0.5 * (
            self.parameters.min_height_m + min(self.parameters.max_height_m, _COVERAGE_MAX_HEIGHT_M)
        )
        farthest = MAX_VIEW_M
        if background is not None:
            farthest = float(np.nanmax(background)) if np.isfinite(background).any() else 0.0
        floor = self.floor.within(*self._box_in_view(shape, farthest))
        visible, nearest, depths = [], [], []
        for first in range(0, max(len(floor), 1), CELLS_AT_ONCE):
            cells = FloorCells(floor.index[first : first + CELLS_AT_ONCE], floor.size_m)
            pixels, depth = self.pinhole.to_pixels(
                np.column_stack([cells.centres, np.full(len(cells), height)])
            )
            with np.errstate(invalid="ignore"):
                inside = (pixels >= 0.0).all(axis=1) & (pixels <= np.subtract(shape[:2], 1)).all(axis=1)
            seen = np.flatnonzero(inside & (depth > 0.0))
            pixel = np.rint(pixels[seen]).astype(np.int64)
            if background is None:
                before = visible_from(floor, cells.select(seen), self.pinhole.position[:2])
            else:
                behind = background[pixel[:, 0], pixel[:, 1]]
                before = depth[seen] < np.where(np.isnan(behind), farthest, behind)
            visible.append(first + seen[before])
            nearest.append(pixel[before])
            depths.append(depth[seen][before])
        self.coverage = FloorCells(floor.index[np.concatenate(visible)], floor.size_m)
        self._pixels, self._depths = np.concatenate(nearest), np.concatenate(depths)

    def _box_in_view(self, shape: tuple[int, ...], farthest_m: float) -> Floats:
        """The box of the map frame, as its corners `(2, 2)`, that holds the view of an image `(rows, cols)` up to a depth."""
        rows, cols = (np.arange(size) for size in shape[:2])
        edge_rows = np.concatenate([np.zeros_like(cols), np.full_like(cols, shape[0] - 1), rows, rows])
        edge_cols = np.concatenate([cols, cols, np.zeros_like(rows), np.full_like(rows, shape[1] - 1)])
        border = self.pinhole.to_map(edge_rows, edge_cols, np.full(len(edge_rows), farthest_m))[:, :2]
        points = np.concatenate([border, self.pinhole.position[None, :2]])
        if not np.isfinite(points).all():  # a lens whose formula has no inverse there
            return np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
        cell_m = self.parameters.cell_m
        return np.array([points.min(axis=0) - cell_m, points.max(axis=0) + cell_m])

    def _is_visible(self, depth_m: Depth | None) -> Mask:
        """Mask `(m,)` of the covered cells that nothing hides in this frame; by colours alone, all of them."""
        if depth_m is None:
            return np.ones(len(self.coverage), np.bool_)
        before = depth_m[self._pixels[:, 0], self._pixels[:, 1]]
        with np.errstate(invalid="ignore"):
            return np.asarray(~(before < self._depths - _OCCLUSION_M))
