"""Particles at the start: about a start pose, or uniform over the free space of the map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.filters.free_space import draw_free_poses
from gridslam.filters.particles import Particles
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.config import IspaceMclConfig


def initial_particles(
    config: IspaceMclConfig, free: NDArray[np.bool_], occupancy: OccupancyGrid, rng: np.random.Generator
) -> Particles:
    """The largest number of particles, with equal weights, about the config's start or over the free cells `(rows, cols)`.

    Raises ConfigError: the start lies off the map.
    """
    count = config.particles.max
    if config.start is None:
        return Particles.even(draw_free_poses(free, occupancy, count, rng))
    _check_start(config.start, occupancy)
    noise = rng.standard_normal((count, 3)) * config.start_std
    poses = np.asarray(config.start) + noise
    poses[:, 2] = se2.wrap_angle(poses[:, 2])
    return Particles.even(poses)


def _check_start(start: tuple[float, float, float], occupancy: OccupancyGrid) -> None:
    """Raises ConfigError for a start off the map, where no scan could correct the filter."""
    shape = occupancy.probability.shape
    limit = occupancy.geometry.resolution_m * 2.0**31  # no grid has more cells: no cast may overflow
    cell = occupancy.geometry.cells(np.clip(np.array([start[:2]]), -limit, limit))[0]
    if not ((cell >= 0) & (cell < shape)).all():
        corner, far = occupancy.geometry.centres(np.array([[0, 0], [shape[0] - 1, shape[1] - 1]]))
        raise ConfigError(
            f"method.start: ({start[0]:g}, {start[1]:g}) lies off the map, which extends from "
            f"({corner[0]:.2f}, {corner[1]:.2f}) to ({far[0]:.2f}, {far[1]:.2f}) m"
        )
