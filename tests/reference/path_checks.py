"""Checks of a planned path by dense samples and the occupied squares near them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]


class Squares:
    """The blocked cells of a map (not turned) as squares, P > 0.9 or unknown, with a closed border."""

    def __init__(self, occupancy: OccupancyGrid) -> None:
        blocked = np.pad(
            (occupancy.probability > 0.9) | np.isnan(occupancy.probability), 1, constant_values=True
        )
        inside = blocked.copy()
        inside[1:-1, 1:-1] = (
            blocked[1:-1, 1:-1]
            & blocked[:-2, 1:-1]
            & blocked[2:, 1:-1]
            & blocked[1:-1, :-2]
            & blocked[1:-1, 2:]
        )
        inside[[0, -1]] = inside[:, [0, -1]] = False
        self.side = occupancy.geometry.resolution_m
        self.centres = (
            np.argwhere(blocked & ~inside)[:, ::-1] - 0.5
        ) * self.side + occupancy.geometry.origin_xy_m
        self.tree = cKDTree(self.centres)

    def distances(self, points: Floats, max_distance: float) -> Floats:
        """Distance (m) of every point `(n, 2)` to the nearest square, at most `max_distance`."""
        out = np.full(len(points), max_distance)
        search_radius = max_distance + 0.7072 * self.side
        close = np.flatnonzero(self.tree.query(points, distance_upper_bound=search_radius)[0] < search_radius)
        for i, near in zip(close, self.tree.query_ball_point(points[close], search_radius), strict=True):
            gaps = np.maximum(np.abs(self.centres[near] - points[i]) - 0.5 * self.side, 0.0)
            out[i] = min(max_distance, float(np.hypot(*gaps.T).min()))
        return out


def largest_jump(segments: list[dict[str, float]]) -> tuple[float, float]:
    """Largest gap (m) and yaw difference (rad) between the end of a segment and the start of the next."""
    gap = yaw_jump = 0.0
    for here, after in pairwise(segments):
        end = drive(here)[-1]
        gap = max(gap, float(np.hypot(end[0] - after["x"], end[1] - after["y"])))
        yaw_jump = max(yaw_jump, abs(float(np.angle(np.exp(1j * (end[2] - after["yaw"]))))))
    return gap, yaw_jump


def drive(segment: dict[str, float], spacing_m: float = 0.01) -> Floats:
    """Poses `(n, 3)` along a segment of `report.json`, integrated by the midpoint rule in steps of a tenth of the spacing."""
    length, angle = segment["length_m"], segment["angle_rad"]
    count = max(int(np.ceil(max(abs(length), 0.2 * abs(angle)) / spacing_m)), 1)
    fine = 10 * count
    yaw = segment["yaw"] + angle * (np.arange(fine) + 0.5) / fine
    x = segment["x"] + np.concatenate([[0.0], np.cumsum(np.cos(yaw))]) * length / fine
    y = segment["y"] + np.concatenate([[0.0], np.cumsum(np.sin(yaw))]) * length / fine
    turned = segment["yaw"] + angle * np.arange(fine + 1) / fine
    return np.column_stack([x, y, turned])[::10]


def escapes(squares: Squares, pose: Floats, radius_m: float, robot_m: float, seed: int) -> bool:
    """Whether any of 600 random drives (left, right or straight, changing occasionally) gets 1.5 m away from a pose.

    1.5 m are more than a full circle of 0.2 m radius.
    """
    rng = np.random.default_rng(seed)
    n, step = 600, 0.02
    x, y, yaw = (np.full(n, v) for v in pose)
    curvature = rng.choice([-1.0, 0.0, 1.0], n) / radius_m
    for _ in range(75):
        change = rng.random(len(x)) < 0.1
        curvature = np.where(change, rng.uniform(-1.0, 1.0, len(x)) / radius_m, curvature)
        middle = yaw + 0.5 * step * curvature
        x, y, yaw = x + step * np.cos(middle), y + step * np.sin(middle), yaw + step * curvature
        alive = squares.distances(np.column_stack([x, y]), robot_m + 0.01) >= robot_m
        if not alive.any():
            return False
        x, y, yaw, curvature = x[alive], y[alive], yaw[alive], curvature[alive]
    return True
