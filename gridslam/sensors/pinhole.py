"""The pinhole camera: between pixels with depths and points in the map frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import CameraInfo, Transform
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

    def moved(self, pose: Floats) -> Pinhole:
        """The camera moved by a planar pose `(3,)` (m, m, rad) of the map frame."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        about_z = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        position = np.append(se2.transform_points(pose, self.position[None, :2])[0], self.position[2])
        return replace(self, rotation=about_z @ self.rotation, position=position)

    def to_map(self, rows: NDArray[np.int64], cols: NDArray[np.int64], depth_m: Floats) -> Floats:
        """Map points `(n, 3)` of pixels (row, col) with depths along the optical axis `(n,)`."""
        directions = self._directions(rows, cols)
        points = np.column_stack([directions * depth_m[:, None], depth_m])
        return np.asarray(points @ self.rotation.T + self.position)

    def floor_depths(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Floats:
        """Depths `(n,)` along the optical axis at which the rays of pixels meet the floor; NaN for those that do not."""
        directions = self._directions(rows, cols)
        climb = directions @ self.rotation[2, :2] + self.rotation[2, 2]  # metres of height per metre of depth
        with np.errstate(divide="ignore"):
            return np.where(climb < 0.0, -self.position[2] / climb, np.nan)

    def _directions(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> Floats:
        """x and y over depth `(n, 2)` of the points that pixels show."""
        centre, focal = self.centre_px, self.focal_px
        shown = np.stack([(cols - centre[0]) / focal[0], (rows - centre[1]) / focal[1]], axis=1)
        return shown if self.lens is None else self.lens.undistorted(shown)

    def to_pixels(self, points: Floats) -> tuple[Floats, Floats]:
        """Pixels `(n, 2)` (row, col) of map points `(n, 3)`, and their depths `(n,)`, which are <= 0 behind the camera."""
        local = (points - self.position) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            directions = local[:, :2] / local[:, 2:]
        if self.lens is not None:
            directions = self.lens.distorted(directions)
        rows, cols = (directions * self.focal_px + self.centre_px)[:, ::-1].T
        return np.stack([rows, cols], axis=1), local[:, 2]
