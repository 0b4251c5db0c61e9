"""Camera geometry: rotations of optical frames, the stereo camera, and the side of a camera by its name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_NUMBERED = {"infra1": "left", "infra2": "right", "cam0": "left", "cam1": "right"}
_NUMBERED_NAME = re.compile(r"(?<![a-z0-9])(infra[12]|cam[01])(?![0-9])")


OPTICAL_FORWARD = (0.5, -0.5, 0.5, -0.5)  # orientation (w, x, y, z) of an optical frame that faces forward


def rotation_matrix(quat_wxyz: Sequence[float]) -> Floats:
    """The rotation `(3, 3)` of a unit quaternion."""
    w, x, y, z = quat_wxyz
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of_matrix(rotation: Floats) -> tuple[float, float, float, float]:
    """The unit quaternion w, x, y, z of a rotation `(3, 3)`."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return w, x, y, z


def side_of(names: Iterable[str]) -> str:
    """`left` or `right` where one of the names (topic, camera, frame) says so, else empty.

    Numbered cameras of stereo heads are infra1 and infra2 (RealSense), cam0 and cam1 (EuRoC).
    """
    for name in names:
        lowered = name.lower()
        if ("left" in lowered) != ("right" in lowered):
            return "left" if "left" in lowered else "right"
        numbers = {_NUMBERED[found] for found in _NUMBERED_NAME.findall(lowered)}
        if len(numbers) == 1:
            return numbers.pop()
    return ""


@dataclass(frozen=True, slots=True)
class StereoHead:
    """The left camera: focal length and centre in pixels, baseline, and T_base_optical as rotation `(3, 3)` and position `(3,)`.

    The optical frame has x to the right, y down and z along the view; d = f B / z.
    """

    focal_px: float
    centre_px: tuple[float, float]
    baseline_m: float
    rotation: Floats
    position: Floats

    @staticmethod
    def of_extrinsics(
        focal_px: float,
        centre_px: tuple[float, float],
        baseline_m: float,
        quat_wxyz: tuple[float, float, float, float],
        position: tuple[float, float, float],
    ) -> StereoHead:
        """The stereo head with its rotation given as a quaternion."""
        rotation = rotation_matrix(quat_wxyz)
        return StereoHead(focal_px, centre_px, baseline_m, rotation, np.array(position))

    @property
    def looks_along_the_ground(self) -> bool:
        """Whether the optical axis is closer to the ground than to the vertical, with the image upright."""
        return bool(abs(self.rotation[2, 2]) < 0.7 and self.rotation[2, 1] < -0.7)

    def slope(self, rows: int, cols: int) -> NDArray[np.float32]:
        """Height of each pixel's point above the camera per metre of depth, `(rows, cols)`."""
        x = (np.arange(cols) - self.centre_px[0]) / self.focal_px
        y = (np.arange(rows) - self.centre_px[1]) / self.focal_px
        up = self.rotation[2]
        return np.asarray(up[0] * x[None] + up[1] * y[:, None] + up[2], np.float32)

    def bearings(self, columns: Floats) -> Floats:
        """Bearings `(m,)` (rad) in the base frame of the horizontal rays through image columns `(m,)`."""
        x = (columns - self.centre_px[0]) / self.focal_px
        up = self.rotation[2]
        y = -(up[0] * x + up[2]) / up[1]
        rays = np.stack([x, y, np.ones_like(x)], axis=1) @ self.rotation.T
        return np.asarray(np.arctan2(rays[:, 1], rays[:, 0]))

    def depths(self, bearings: Floats, ranges_m: Floats, height_m: float) -> Floats:
        """Depths `(m, n)` (m) along the optical axis of points at bearings `(m,)`, ground ranges `(n,)` and a height."""
        ahead = self.rotation[:2, 2]
        along = np.cos(bearings) * ahead[0] + np.sin(bearings) * ahead[1]
        above = (height_m - self.position[2]) * self.rotation[2, 2]
        return np.asarray(along[:, None] * ranges_m[None] + above)
