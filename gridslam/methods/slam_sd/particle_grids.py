"""The maps of all particles: surfaces to match with, and log-odds that tell free space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import log_odds, surfel_likelihood, surfel_registration, surfels
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.tiled import TileStore
from gridslam.methods.slam_sd.config import SlamSdConfig

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ITERATIONS = 8


class ParticleGrids:
    """For each particle a map of surface elements and one of log-odds, on tiles that particles share until they differ."""

    def __init__(self, config: SlamSdConfig) -> None:
        self._config = config
        n = config.particles
        self.surfaces = TileStore(n, surfels.CHANNELS, config.filter.resolution_m, config.memory_limit_mb)
        self.cells = TileStore(n, 1, config.filter.free_resolution_m, config.memory_limit_mb)

    @property
    def memory_mb(self) -> float:
        """Of all tiles, 10^6 bytes."""
        return self.surfaces.memory_mb + self.cells.memory_mb

    def insert(self, scan: PreparedScan, poses: Floats) -> None:
        """Draw a key scan into all particles' maps, at the pose of each `(n, 3)`."""
        config = self._config
        maps = np.arange(len(poses))
        self.surfaces.own_end_points(maps, poses, scan.surface)
        surfels.insert_surfels_all(
            self.surfaces.directory,
            self.surfaces.pool,
            self.surfaces.origin,
            config.filter.resolution_m,
            poses,
            scan.surface,
            scan.surface_normals,
        )
        self.cells.own_beams(maps, poses, scan.viewpoint, scan.points)
        log_odds.insert_beams_all(
            self.cells.directory,
            self.cells.pool,
            self.cells.origin,
            config.filter.free_resolution_m,
            poses,
            scan.viewpoint,
            scan.points,
            config.map.hit,
            config.map.miss,
            config.map.limit,
        )

    def draw_anew(self, particle: int, scans: Sequence[PreparedScan], poses: Floats) -> None:
        """Forget one particle's maps, and draw these scans into them from their poses `(k, 3)`."""
        config = self._config
        self.surfaces.clear(particle)
        self.cells.clear(particle)
        points = np.concatenate([scan.surface for scan in scans])
        normals = np.concatenate([scan.surface_normals for scan in scans])
        first = _first_rows([scan.surface for scan in scans])
        eye = scans[0].viewpoint  # one lidar, one place on the robot
        store = self.surfaces
        store.own_trail(particle, poses, eye, points, first, with_beams=False)
        surfels.insert_surfel_trail(
            store.directory[particle],
            store.pool,
            store.origin,
            store.resolution_m,
            poses,
            points,
            normals,
            first,
        )
        points = np.concatenate([scan.points for scan in scans])
        first = _first_rows([scan.points for scan in scans])
        store = self.cells
        store.own_trail(particle, poses, eye, points, first, with_beams=True)
        log_odds.insert_beam_trail(
            store.directory[particle],
            store.pool,
            store.origin,
            store.resolution_m,
            poses,
            eye,
            points,
            first,
            config.map.hit,
            config.map.miss,
            config.map.limit,
        )

    def register(
        self, points: Floats, normals: Floats, starts: Floats, priors: Floats, information: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """The scan in every particle's map: poses, its information about them, the share of its points that found a surface."""
        config = self._config.filter
        poses, scan_information, used = surfel_registration.register_all(
            self.surfaces.directory,
            self.surfaces.pool,
            self.surfaces.origin,
            config.resolution_m,
            points,
            normals,
            starts,
            priors,
            information,
            config.sigma_m,
            config.reach_m,
            2.0 * config.sigma_m,
            ITERATIONS,
            0.5 * config.least_fit * len(points),
        )
        return poses, scan_information, used / max(len(points), 1)

    def log_likelihood(self, viewpoint: Floats, points: Floats, normals: Floats, poses: Floats) -> Floats:
        """Of the scan at poses `(n, 3)`, each in its particle's map; `(n,)`."""
        config = self._config.filter
        return np.asarray(
            surfel_likelihood.log_likelihood_all(
                self.surfaces.directory,
                self.surfaces.pool,
                self.surfaces.origin,
                config.resolution_m,
                viewpoint,
                points,
                normals,
                poses,
                config.sigma_m,
                config.reach_m,
                config.random_share,
                self.cells.directory,
                self.cells.pool,
                self.cells.origin,
                config.free_resolution_m,
            )
        )

    def redistribute(self, ancestors: Ints) -> None:
        """Particle k goes on with the maps of ancestors[k]."""
        self.surfaces.redistribute(ancestors)
        self.cells.redistribute(ancestors)


def _first_rows(parts: Sequence[Floats]) -> Ints:
    """Where each part begins when all are concatenated, and where the last one ends."""
    first = np.zeros(len(parts) + 1, np.int64)
    np.cumsum([len(part) for part in parts], out=first[1:])
    return first
