"""Likelihood of a place in a drawing: its visible surfaces lie near drawn walls, and the space before them is drawn free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.drawings.drawn_field import crossed_segments, sum_over_stretched_points
from gridslam.maps.distances import distances_to
from gridslam.maps.drawings.drawing import DrawnMap

Floats = NDArray[np.float64]
Field = NDArray[np.float32]

OUTLIER_FRACTION = 0.15  # fraction of points that no drawn wall explains; one point costs at most -log of it
TABLE_ENTRIES = 256  # steps of less than 2 % of sigma
MAX_SIGMAS = 4.0  # beyond it the Gaussian, below 4e-4, is nothing beside the outliers
OPEN_WEIGHT = 1.0  # cost of a point of the free space that is drawn as wall or outside
MAX_DEPTH_M = 0.6  # depth at which such a point counts in full


class DrawnEvidence:
    """Distances (drawing units) `(rows, cols)` to walls, and to what is drawn free; 0 on walls and in the free space."""

    def __init__(self, drawn: DrawnMap) -> None:
        self.cell = drawn.geometry.resolution_m
        inside = drawn.free if drawn.reading is None else drawn.free | drawn.reading.enclosed
        self.to_wall = np.asarray(distances_to(drawn.walls) * np.float32(self.cell))
        self.to_free = np.asarray(distances_to(inside) * np.float32(self.cell))
        self.walls = drawn.walls

    def log_likelihood(self, view: Floats, open_view: Floats, states: Floats, sigma_m: float) -> Floats:
        """Log-likelihoods `(n,)` of a place's views for states `(n, 5)`: x, y, yaw, log scales."""
        per_m = (TABLE_ENTRIES - 1) / (MAX_SIGMAS * sigma_m)
        distances = np.arange(TABLE_ENTRIES) / per_m
        near = np.exp(-0.5 * (distances / sigma_m) ** 2)
        near[-1] = 0.0
        walls = np.log((1.0 - OUTLIER_FRACTION) * near + OUTLIER_FRACTION)
        depth = -OPEN_WEIGHT * np.minimum(distances / MAX_DEPTH_M, 1.0) ** 2
        return self._sums(self.to_wall, walls, view, states, per_m) + self._sums(
            self.to_free, depth, open_view, states, per_m
        )

    def crossed(self, starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Whether a drawn wall lies between positions `starts` and `ends` `(n, 2)`, `(n,)`."""
        return crossed_segments(
            self.walls, self.cell, np.ascontiguousarray(starts), np.ascontiguousarray(ends)
        )

    def _sums(self, field: Field, table: Floats, points: Floats, states: Floats, per_m: float) -> Floats:
        return np.asarray(
            sum_over_stretched_points(
                field=field,
                resolution_m=self.cell,
                table=table.astype(np.float32),
                entries_per_m=per_m,
                points=np.ascontiguousarray(points),
                states=np.ascontiguousarray(states),
            )
        )


def to_drawing(states: Floats, offsets: Floats) -> Floats:
    """Points at offsets `(n, 2)` (m, map frame) from places in states `(n, 5)`, in the drawing; the shapes broadcast."""
    cos, sin = np.cos(states[..., 2]), np.sin(states[..., 2])
    x, y = offsets[..., 0], offsets[..., 1]
    drawn = np.empty((*np.broadcast_shapes(cos.shape, x.shape), 2))
    drawn[..., 0] = states[..., 0] + np.exp(states[..., 3]) * (cos * x - sin * y)
    drawn[..., 1] = states[..., 1] + np.exp(states[..., 4]) * (sin * x + cos * y)
    return drawn
