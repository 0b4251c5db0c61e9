"""The maps of all particles: surfaces to match against, and log-odds that mark free space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.grids import log_odds
from gridslam.kernels.scan_matching import surfel_likelihood, surfel_registration, surfels
from gridslam.kernels.scan_matching.surfel_likelihood import EndpointModel
from gridslam.kernels.scan_matching.surfel_registration import PosePriors, Registration
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.lidar_slam.grid_map import UPDATE
from gridslam.lidar_slam.scans import PreparedScan, scan_set
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SURFACE_CELL_M = 0.2  # one surface element each, as in the front end's local maps
FREE_SPACE_CELL_M = 0.2  # coarse: it only weighs particles, and the map is drawn from the final path
SIGMA_M = 0.06  # standard deviation of an endpoint about a surface: range noise and the particle's own drift in the map
MAX_CORRESPONDENCE_M = 0.3
RANDOM_RATIO = 0.1  # ratio of readings that no surface explains
MAX_ITERATIONS = 8
# Of `min_inlier_ratio`: with fewer correspondences no match is possible any more
MIN_CORRESPONDENCE_RATIO = 0.5
ENDPOINT_MODEL = EndpointModel(SIGMA_M, MAX_CORRESPONDENCE_M, RANDOM_RATIO)


class Matches(NamedTuple):
    """Poses `(n, 3)`, the scan's information about them `(n, 3, 3)`, and the inlier ratios `(n,)`."""

    poses: Floats
    information: Floats
    inlier_ratio: Floats


class ParticleGrids:
    """A surface map and a log-odds map per particle, on tiles that particles share until they differ.

    Methods that write raise MethodError if the maps would exceed the memory limit.
    """

    def __init__(self, particles: int, memory_limit_mb: float) -> None:
        self.surfaces = TileStore(particles, surfels.CHANNELS, SURFACE_CELL_M, memory_limit_mb)
        self.cells = TileStore(particles, 1, FREE_SPACE_CELL_M, memory_limit_mb)

    @property
    def memory_mb(self) -> float:
        """Memory of all tiles, 10^6 bytes."""
        return self.surfaces.memory_mb + self.cells.memory_mb

    def insert(self, scan: PreparedScan, poses: Floats) -> None:
        """Draw a key scan into all particles' maps, at the pose of each `(n, 3)`."""
        maps = np.arange(len(poses))
        self.surfaces.own_endpoints(maps, poses, scan.surface)
        surfels.insert_surfels_all(self.surfaces.maps, poses, scan.surface_points)
        self.cells.own_beams(maps, poses, scan.viewpoint, scan.points)
        beams = log_odds.BeamBundle(scan.viewpoint, scan.points)
        log_odds.insert_beams_all(self.cells.maps, poses, beams, UPDATE)

    def redraw(self, particle: int, scans: Sequence[PreparedScan], poses: Floats) -> None:
        """Clear the maps of one particle and draw these scans into them from their poses `(k, 3)`."""
        self.surfaces.clear(particle)
        self.cells.clear(particle)
        viewpoint = scans[0].viewpoint  # one lidar at one place on the robot
        surfaces = scan_set([scan.surface_points for scan in scans])
        self.surfaces.own_scans(particle, poses, viewpoint, surfaces, with_beams=False)
        surfels.insert_surfels_of_scans(self.surfaces.map(particle), poses, surfaces)
        endpoints = scan_set([scan.matching_points for scan in scans])
        self.cells.own_scans(particle, poses, viewpoint, endpoints, with_beams=True)
        log_odds.insert_beams_of_scans(self.cells.map(particle), poses, viewpoint, endpoints, UPDATE)

    def register(
        self, scan: OrientedPoints, starts: Floats, priors: PosePriors, min_inlier_ratio: float
    ) -> Matches:
        """Register a scan in every particle's map, from starts `(n, 3)`."""
        settings = Registration(
            SIGMA_M,
            MAX_CORRESPONDENCE_M,
            final_correspondence_m=2.0 * SIGMA_M,
            max_iterations=MAX_ITERATIONS,
            min_correspondences=MIN_CORRESPONDENCE_RATIO * min_inlier_ratio * len(scan.points),
        )
        poses, information, used = surfel_registration.register_all(
            self.surfaces.maps, scan, starts, priors, settings
        )
        return Matches(poses, information, used / max(len(scan.points), 1))

    def log_likelihood(self, viewpoint: Floats, scan: OrientedPoints, poses: Floats) -> Floats:
        """Log likelihood `(n,)` of a scan at poses `(n, 3)`, each in its particle's map; `viewpoint` (2,) is the lidar's."""
        return np.asarray(
            surfel_likelihood.log_likelihood_all(
                self.surfaces.maps,
                self.cells.maps,
                viewpoint=viewpoint,
                scan=scan,
                poses=poses,
                model=ENDPOINT_MODEL,
            )
        )

    def redistribute(self, ancestors: Ints) -> None:
        """Resampling: particle k continues with the maps of ancestors[k]; `ancestors` `(n,)`."""
        self.surfaces.redistribute(ancestors)
        self.cells.redistribute(ancestors)
