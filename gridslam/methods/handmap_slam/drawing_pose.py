"""The robot's pose in the drawing, and conversion between metres of the world and drawing units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DrawingPose:
    """The robot in the drawing frame: origin at the lower left corner, lengths in drawing units (0.1 per pixel).

    `yaw_rad` is the heading before the drawing is stretched: a point p of the robot's frame (m) lies at
    (x, y) + diag(scale_x, scale_y) R(yaw) p. The scales are drawing units per metre along the drawing's axes, equal unless they
    are estimated separately. `position_std` is the standard deviation of the position (drawing units), `inlier_ratio` the
    fraction of the scan's points close to drawn walls.
    """

    stamp_ns: int
    x: float
    y: float
    yaw_rad: float
    scale_x: float
    scale_y: float
    position_std: float
    inlier_ratio: float

    @property
    def mean_scale(self) -> float:
        """The geometric mean of both scales."""
        return float((self.scale_x * self.scale_y) ** 0.5)

    def to_drawing(self, points_m: Floats) -> Floats:
        """Points `(n, 2)` of the robot's frame (m) in the drawing frame."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        rotated = np.asarray(points_m) @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(rotated * (self.scale_x, self.scale_y) + (self.x, self.y))

    def from_drawing(self, points: Floats) -> Floats:
        """Points `(n, 2)` of the drawing frame in the robot's frame (m)."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        local = (np.asarray(points) - (self.x, self.y)) / (self.scale_x, self.scale_y)
        return np.asarray(local @ np.array([[cos, -sin], [sin, cos]]))

    def after(self, step: Floats, stamp_ns: int | None = None) -> DrawingPose:
        """The pose after a motion `(3,)` of the robot (m, m, rad)."""
        x, y = self.to_drawing(step[None, :2])[0].tolist()
        yaw = float(se2.wrap_angle(self.yaw_rad + step[2]))
        return replace(self, x=x, y=y, yaw_rad=yaw, stamp_ns=self.stamp_ns if stamp_ns is None else stamp_ns)


def scattered(states: Floats, std: Floats, rng: np.random.Generator, *, separate_scales: bool) -> Floats:
    """Particles `(n, 5)` (x, y in drawing units, yaw, log scales) drawn about given ones `(n, 5)`; their yaws are not wrapped.

    `std` `(5,)` are the standard deviations in metres of the world, radians and of the log scales, which change alike unless
    they are separate.
    """
    noise = rng.standard_normal(states.shape) * std
    noise[:, :2] *= np.exp(states[:, 3:])
    if not separate_scales:
        noise[:, 4] = noise[:, 3]
    return np.asarray(states + noise)
