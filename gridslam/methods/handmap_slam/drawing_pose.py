"""The robot in the drawing, and how metres of the world become metres of the drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DrawingPose:
    """The robot in the drawing frame: origin lower left, nominal 0.1 m a pixel.

    `yaw_rad` is the heading before the drawing's stretching: a point p of the robot's frame (m) lies in the drawing at
    (x, y) + diag(scale_x, scale_y) R(yaw) p. The scales are drawing metres per world metre along the drawing's axes, equal
    unless they are estimated separately. `spread_m` is the standard deviation of the position (drawing metres), `fit` the
    share of the scan's points that lie near drawn walls.
    """

    stamp_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    scale_x: float
    scale_y: float
    spread_m: float
    fit: float

    def to_drawing(self, points_m: Floats) -> Floats:
        """Points `(n, 2)` of the robot's frame (world metres) in the drawing frame."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        turned = np.asarray(points_m) @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(turned * (self.scale_x, self.scale_y) + (self.x_m, self.y_m))

    def from_drawing(self, points_m: Floats) -> Floats:
        """Points `(n, 2)` of the drawing frame in the robot's frame (world metres)."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        local = (np.asarray(points_m) - (self.x_m, self.y_m)) / (self.scale_x, self.scale_y)
        return np.asarray(local @ np.array([[cos, -sin], [sin, cos]]))
