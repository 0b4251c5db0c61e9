"""A fixed RGB-D camera: where on the floor something moves, and where on the floor it would be seen.

The dynamic points of ispace-mcl's environment weight (eqs. 5 - 7).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import CameraInfo, Transform
from gridslam.sensors.background import ColourBackground, Depth, DepthBackground

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Focal lengths and centre in pixels, and T_map_optical as rotation `(3, 3)` and position `(3,)`.

    The optical frame has x to the right, y down and z along the view. Lens distortion is not undone: images are rectified.
    """

    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    rotation: Floats
    position: Floats

    @staticmethod
    def of(info: CameraInfo, extrinsics: Transform) -> Pinhole:
        """From the calibration message and the static transform of the optical frame."""
        K = info.K
        return Pinhole(
            (float(K[0, 0]), float(K[1, 1])),
            (float(K[0, 2]), float(K[1, 2])),
            rotation_matrix(extrinsics.quat_wxyz),
            np.array(extrinsics.translation_m),
        )

    def to_map(self, rows: NDArray[np.int64], cols: NDArray[np.int64], depth_m: Floats) -> Floats:
        """Points `(n, 3)` of pixels with depths along the optical axis `(n,)`."""
        x = (cols - self.centre_px[0]) / self.focal_px[0] * depth_m
        y = (rows - self.centre_px[1]) / self.focal_px[1] * depth_m
        return np.asarray(np.stack([x, y, depth_m], axis=1) @ self.rotation.T + self.position)

    def to_pixels(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels `(n, 2)` (row, col) of points `(n, 3)` of the map, and their depths `(n,)`; not positive: behind the camera."""
        seen = (points - self.position) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            cols = seen[:, 0] / seen[:, 2] * self.focal_px[0] + self.centre_px[0]
            rows = seen[:, 1] / seen[:, 2] * self.focal_px[1] + self.centre_px[1]
        return np.stack([rows, cols], axis=1), seen[:, 2]


@dataclass(frozen=True, slots=True)
class CameraSettings:
    """How a camera's pictures are read; see the method's config for the meaning of each."""

    history: int
    threshold: float
    opening_px: int
    closing_px: int
    warm_up: int
    low_m: float
    high_m: float
    stride_px: int
    most_foreground: float
    depth_check: bool
    margin_m: float
    margin_share: float
    moved_share: float
    moved_frames: int
    cell_m: float
    least_area_m2: float


@dataclass(frozen=True, slots=True)
class Sighting:
    """What one frame shows: floor positions `(n, 2)` of all that moves, each of `areas_m2` `(n,)` of its surface.

    `seen` `(m,)` tells of each cell of the camera's `coverage` whether something there would have been seen in this frame.
    """

    points: Floats
    areas_m2: Floats
    seen: NDArray[np.bool_]


@dataclass
class FixedCamera:
    """One camera with what it has learned of its background."""

    pinhole: Pinhole
    settings: CameraSettings
    cells: Floats  # (k, 2) centres of the floor cells that may be seen: the map's free ones
    colour: ColourBackground = field(init=False)
    depth: DepthBackground = field(init=False)
    is_moved: bool = False
    coverage: Floats = field(init=False)  # (m, 2) cells that are seen when nothing is in the way
    _suspicious: int = 0  # frames with other depths that are still to come before it counts as moved
    _pixels: NDArray[np.int64] = field(init=False)  # (m, 2) where the coverage appears
    _depths: Floats = field(init=False)

    def __post_init__(self) -> None:
        s = self.settings
        self.colour = ColourBackground(s.history, s.threshold, s.opening_px, s.closing_px, s.warm_up)
        self.depth = DepthBackground(s.margin_m, s.margin_share)
        self.coverage = np.zeros((0, 2))

    def look(self, pixels: NDArray[np.uint8], depth_m: Depth) -> Sighting | str:
        """What a frame shows, or why it shows nothing: warm_up, light_changed, camera_moved."""
        s = self.settings
        if self.is_moved:
            return "camera_moved"
        foreground = self.colour.foreground(pixels)
        is_learning = self.colour.frames <= s.warm_up
        if not is_learning and foreground.mean() > s.most_foreground:
            self.colour.restart()
            self._suspicious = s.moved_frames
            return "light_changed"
        nearer = self.depth.nearer(depth_m)
        if self._suspicious and not is_learning:
            self._compare(depth_m, foreground)
        if not self._suspicious:
            self.depth.learn(depth_m)
        if is_learning:  # its colours cannot tell people from walls yet
            return "warm_up"
        if self._suspicious or self.is_moved:
            return "camera_moved"
        if not len(self.coverage):
            self._find_coverage()
        if s.depth_check:
            foreground &= nearer
        return Sighting(*self._on_floor(foreground, depth_m), self._seen(depth_m))

    def _compare(self, depth_m: Depth, foreground: NDArray[np.bool_]) -> None:
        """After all colours have changed: was it the light, or are the depths others than those learned as well?

        If they are, frame after frame, the camera was moved; it stays out of use, for its calibration is wrong.
        """
        is_off = self.depth.off_share(depth_m, foreground) > self.settings.moved_share
        self._suspicious = self._suspicious - 1 if is_off else 0
        self.is_moved = is_off and not self._suspicious

    def _on_floor(self, foreground: NDArray[np.bool_], depth_m: Depth) -> tuple[Floats, Floats]:
        """Floor positions of foreground pixels within the height band, and the surface that each stands for."""
        s = self.settings
        step = s.stride_px
        rows, cols = np.nonzero(foreground[::step, ::step])
        rows, cols = rows * step, cols * step
        depths = depth_m[rows, cols].astype(np.float64)
        known = np.isfinite(depths)
        points = self.pinhole.to_map(rows[known], cols[known], depths[known])
        inside = (points[:, 2] > s.low_m) & (points[:, 2] < s.high_m)
        focal = self.pinhole.focal_px[0] * self.pinhole.focal_px[1]
        areas = depths[known][inside] ** 2 * (step * step / focal)
        return points[inside, :2], areas

    def _find_coverage(self) -> None:
        """The floor cells at which something as high as the middle of the band would stand before the background."""
        background = self.depth.depth_m
        assert background is not None
        height = 0.5 * (self.settings.low_m + min(self.settings.high_m, 0.6))
        points = np.column_stack([self.cells, np.full(len(self.cells), height)])
        pixels, depths = self.pinhole.to_pixels(points)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0.0).all(axis=1) & (pixels <= np.subtract(background.shape, 1)).all(axis=1)
        inside &= depths > 0.0
        near = np.zeros((len(pixels), 2), np.int64)
        near[inside] = np.rint(pixels[inside]).astype(np.int64)
        behind = background[near[:, 0], near[:, 1]]
        farthest = float(np.nanmax(background)) if np.isfinite(background).any() else 0.0
        with np.errstate(invalid="ignore"):
            visible = inside & (depths < np.where(np.isnan(behind), farthest, behind))
        self.coverage, self._pixels, self._depths = self.cells[visible], near[visible], depths[visible]

    def _seen(self, depth_m: Depth) -> NDArray[np.bool_]:
        """Cells of the coverage before which nothing stands in this frame."""
        before = depth_m[self._pixels[:, 0], self._pixels[:, 1]]
        with np.errstate(invalid="ignore"):
            return ~(before < self._depths - 0.5)
