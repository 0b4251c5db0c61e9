"""A fixed RGB-D camera: the floor positions of moving objects, and the floor cells in which they are visible.

These are the dynamic points of ispace-mcl's environment weight (eqs. 5 - 7).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import CameraInfo, Transform
from gridslam.sensors.background import ColourBackground, Depth, DepthBackground
from gridslam.sensors.floor_cells import FloorCells
from gridslam.sensors.lens import Lens

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Pinhole camera: focal lengths and principal point in pixels, and T_map_optical as rotation `(3, 3)` and position `(3,)`.

    The optical frame has x to the right, y down and z forward. `lens` is that of raw images; None if they are rectified.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    rotation: Floats
    position: Floats
    lens: Lens | None = None

    @staticmethod
    def of(info: CameraInfo, extrinsics: Transform, is_raw: bool = False) -> Pinhole:
        """The camera of a calibration message and the static transform of its optical frame; `is_raw`: its images are not
        rectified.
        """
        K = info.K
        return Pinhole(
            (float(K[0, 0]), float(K[1, 1])),
            (float(K[0, 2]), float(K[1, 2])),
            rotation_matrix(extrinsics.quat_wxyz),
            np.array(extrinsics.translation_m),
            Lens.of(info) if is_raw else None,
        )

    def to_map(self, rows: NDArray[np.int64], cols: NDArray[np.int64], depth_m: Floats) -> Floats:
        """Map points `(n, 3)` of pixels (row, col) with depths along the optical axis `(n,)`."""
        centre, focal = self.centre_px, self.focal_px
        directions = np.stack([(cols - centre[0]) / focal[0], (rows - centre[1]) / focal[1]], axis=1)
        if self.lens is not None:
            directions = self.lens.undistorted(directions)
        points = np.column_stack([directions * depth_m[:, None], depth_m])
        return np.asarray(points @ self.rotation.T + self.position)

    def to_pixels(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels `(n, 2)` (row, col) of map points `(n, 3)`, and their depths `(n,)`, which are <= 0 behind the camera."""
        local = (points - self.position) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            directions = local[:, :2] / local[:, 2:]
        if self.lens is not None:
            directions = self.lens.distorted(directions)
        rows, cols = (directions * self.focal_px + self.centre_px)[:, ::-1].T
        return np.stack([rows, cols], axis=1), local[:, 2]


@dataclass(frozen=True, slots=True)
class DetectionParameters:
    """How moving objects are detected in the images of one camera."""

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
    moved_ratio: float = 0.12  # a camera with more depths than this off its background may have been moved
    moved_frames: int = 5  # and was moved if that lasts for this many frames
    cell_m: float = 0.1  # size of a floor cell
    min_area_m2: float = 0.01  # less surface above a floor cell is noise


COLOUR_AND_DEPTH = DetectionParameters(history=200, warm_up=5, uses_depth=True)
# The paper's background subtraction. A robot that stands while the background is learned becomes part of it, and without a check
# by depth it is not detected when it leaves: hence the long warm-up, and the long memory for robots that stand later.
COLOUR_ONLY = DetectionParameters(history=500, warm_up=15, uses_depth=False)

_COVERAGE_MAX_HEIGHT_M = 0.6  # the height of a robot: coverage is that of a point half as high
CELLS_AT_ONCE = 1 << 18  # of the floor of a large map
_OCCLUSION_M = 0.5  # a reading this far before a floor cell hides it


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
    """One camera with its background models and the floor cells that it covers."""

    pinhole: Pinhole
    parameters: DetectionParameters
    cells: FloorCells  # of the map that are free
    colour: ColourBackground = field(init=False)
    depth: DepthBackground = field(init=False)
    is_moved: bool = False
    coverage: FloorCells = field(init=False)  # those that the camera sees when nobody is in the room
    _frames_to_judge: int = 0  # mismatching frames still needed before the camera counts as moved
    _pixels: NDArray[np.int64] = field(init=False)  # (m, 2) image positions of the coverage
    _depths: Floats = field(init=False)

    def __post_init__(self) -> None:
        p = self.parameters
        self.colour = ColourBackground(
            p.history, p.threshold, opening_px=p.opening_px, closing_px=p.closing_px, warm_up=p.warm_up
        )
        self.depth = DepthBackground(p.margin_m, p.margin_ratio)
        self.coverage = self.cells.select(np.zeros(len(self.cells), np.bool_))

    def detect(self, pixels: NDArray[np.uint8], depth_m: Depth) -> FloorDetections | FrameSkip:
        """The moving points of a frame, or the reason why the frame has none."""
        p = self.parameters
        if self.is_moved:
            return FrameSkip.CAMERA_MOVED
        foreground = self.colour.foreground(pixels)
        is_learning = self.colour.frames <= p.warm_up
        if not is_learning and foreground.mean() > p.max_foreground_ratio:
            self.colour.restart()
            self._frames_to_judge = p.moved_frames
            return FrameSkip.LIGHT_CHANGED
        nearer = self.depth.nearer(depth_m)
        if self._frames_to_judge and not is_learning:
            self._judge_depths(depth_m, foreground)
        if not self._frames_to_judge:
            self.depth.learn(depth_m)
        if is_learning:  # the colour model cannot separate people from walls yet
            return FrameSkip.WARM_UP
        if self._frames_to_judge or self.is_moved:
            return FrameSkip.CAMERA_MOVED
        if not len(self.coverage):
            self._find_coverage()
        if p.uses_depth:
            foreground &= nearer
        return FloorDetections(*self._project(foreground, depth_m), self._is_visible(depth_m))

    def _judge_depths(self, depth_m: Depth, foreground: NDArray[np.bool_]) -> None:
        """Decide, after all colours have changed, between a switched light and a moved camera.

        If the depths differ from the background frame after frame, the camera was moved. It is not used again, because its
        calibration is wrong now.
        """
        differs = self.depth.mismatch_ratio(depth_m, foreground) > self.parameters.moved_ratio
        self._frames_to_judge = self._frames_to_judge - 1 if differs else 0
        self.is_moved = differs and not self._frames_to_judge

    def _project(self, foreground: NDArray[np.bool_], depth_m: Depth) -> tuple[Floats, Floats]:
        """Floor positions `(n, 2)` of the foreground pixels within the height band, and the surface `(n,)` of each, m^2."""
        p = self.parameters
        step = p.stride_px
        rows, cols = np.nonzero(foreground[::step, ::step])
        rows, cols = rows * step, cols * step
        depths = depth_m[rows, cols].astype(np.float64)
        known = np.isfinite(depths)
        points = self.pinhole.to_map(rows[known], cols[known], depths[known])
        inside = (points[:, 2] > p.min_height_m) & (points[:, 2] < p.max_height_m)
        focal = self.pinhole.focal_px[0] * self.pinhole.focal_px[1]
        areas = depths[known][inside] ** 2 * (step * step / focal)
        return points[inside, :2], areas

    def _find_coverage(self) -> None:
        """Find the floor cells above which a point at half a robot's height lies in view and before the background."""
        background = self.depth.depth_m
        assert background is not None
        height = 0.5 * (
            self.parameters.min_height_m + min(self.parameters.max_height_m, _COVERAGE_MAX_HEIGHT_M)
        )
        farthest = float(np.nanmax(background)) if np.isfinite(background).any() else 0.0
        visible, nearest, depths = [], [], []
        for first in range(0, max(len(self.cells), 1), CELLS_AT_ONCE):
            cells = FloorCells(self.cells.index[first : first + CELLS_AT_ONCE], self.cells.size_m)
            pixels, depth = self.pinhole.to_pixels(
                np.column_stack([cells.centres, np.full(len(cells), height)])
            )
            with np.errstate(invalid="ignore"):
                inside = (pixels >= 0.0).all(axis=1) & (pixels <= np.subtract(background.shape, 1)).all(
                    axis=1
                )
            seen = np.flatnonzero(inside & (depth > 0.0))
            pixel = np.rint(pixels[seen]).astype(np.int64)
            behind = background[pixel[:, 0], pixel[:, 1]]
            before = depth[seen] < np.where(np.isnan(behind), farthest, behind)
            visible.append(first + seen[before])
            nearest.append(pixel[before])
            depths.append(depth[seen][before])
        self.coverage = FloorCells(self.cells.index[np.concatenate(visible)], self.cells.size_m)
        self._pixels, self._depths = np.concatenate(nearest), np.concatenate(depths)

    def _is_visible(self, depth_m: Depth) -> NDArray[np.bool_]:
        """Mask `(m,)` of the covered cells that nothing hides in this frame."""
        before = depth_m[self._pixels[:, 0], self._pixels[:, 1]]
        with np.errstate(invalid="ignore"):
            return ~(before < self._depths - _OCCLUSION_M)
