"""The map of probabilities and its update by one frame (stereo-bayes 2.3, 2.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.stereo.chain import RayEvidence, expected_behind, likelihoods_of_rays
from gridslam.kernels.stereo.polar_window import GridRays, priors_of_rays
from gridslam.kernels.stereo.stereo_update import (
    CellEvidence,
    UpdateRule,
    apply_update,
    couple_neighbouring_rays,
)
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods.stereo_bayes.adaptive_correlation import CorrelationEstimate
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import StereoRays, range_edges
from gridslam.methods.stereo_bayes.visible_cells import visible_cells
from gridslam.methods.stereo_bayes.window import PolarValues, RayStart, window, window_radius
from gridslam.sensors.stereo_likelihood import StereoNoise, first_likelihoods

Floats = NDArray[np.float64]

MARGIN_CELLS = 2  # of the grid around the rays, and of the cells around a camera where free space starts
MIN_PROBABILITY = 1e-3  # cells stay this far from 0 and 1, so that they can still change
# Evidence of cells that no ray meets: any measurement is equally likely whether they are occupied or not.
NO_EVIDENCE = {"occupied": 1.0, "empty": 1.0, "reached": 0.0, "reached_surface": 0.0, "expected": 0.0}


class BeliefMap:
    """P(occupied) of every cell. The rays of a frame are evaluated with the map as it was before the frame.

    Every cell receives the evidence of the one ray through its centre, so that cells near the robot, which many rays cross, do
    not receive the same evidence several times.
    """

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        # Log-odds of a cell relative to the prior, and the largest probability with which a ray has reached it.
        self._grid = GrowingGrid(config.resolution_m, config.memory_limit_mb, (2,))
        self._prior = float(np.log(config.prior / (1.0 - config.prior)))
        self._count = len(range_edges(config)) - 1  # cells of a ray
        self._cameras: list[Floats] = []  # positions, m
        self.correlation = CorrelationEstimate(config.correlation.r0)
        self._rule = UpdateRule(
            weight=config.frame_weight,
            prior_log_odds=self._prior,
            max_log_odds=float(np.log((1.0 - MIN_PROBABILITY) / MIN_PROBABILITY)),
            min_probability=MIN_PROBABILITY,
            behind_once=config.advanced.correlation.behind == "once",
        )

    def noise(self, disparity_range_px: float) -> StereoNoise:
        """The noise of the sensor, whose false matches have disparities of up to `disparity_range_px`."""
        advanced = self._config.advanced.observation
        return StereoNoise(
            self._config.observation.sigma_px, advanced.p_none, advanced.p_false, disparity_range_px
        )

    def update(self, pose: Floats, covariance: Floats, rays: StereoRays, noise: StereoNoise) -> None:
        """Update the map by the rays of a frame taken at T_map_base `(3,)` with covariance `(3, 3)`."""
        if not len(rays.bearings):
            return
        config, count = self._config, self._count
        averaged = covariance if config.advanced.pose.blur else np.zeros((3, 3))
        camera = se2.transform_points(pose, rays.origin[None])[0]
        radius = config.resolution_m * window_radius(self._ray_start(camera), count, averaged)
        self._grid.cover(np.array([camera - radius, camera + radius]), MARGIN_CELLS)
        yaw = float(pose[2])
        default = np.array([NO_EVIDENCE[name] for name in CellEvidence._fields])
        evidence = np.stack(self._evidence(camera, yaw, rays, noise))
        polar = PolarValues(evidence, default, rays.bearings + yaw)
        (rows, cols), values = window(polar, self._ray_start(camera), averaged)
        cells = self._grid.values[rows, cols]
        apply_update(cells[..., 0], cells[..., 1], CellEvidence(*values), self._rule)
        self._cameras.append(camera)
        if config.advanced.correlation.mode == "adaptive":
            self.correlation.update(self.probability(), config.resolution_m)

    def probability(self) -> Floats:
        """P(occupied) `(rows, cols)` of all cells; the prior in unknown ones."""
        return np.asarray(1.0 / (1.0 + np.exp(-(self._grid.values[..., 0] + self._prior))))

    def occupancy(self) -> OccupancyGrid:
        """The map of the visible cells, NaN elsewhere.

        What the chain expects behind surfaces is only in the layer.
        """
        config, probability = self._config, self.probability()
        known = self._grid.values[..., 1] >= config.advanced.map.min_visibility
        rows, cols = np.nonzero(known)
        if not len(rows):
            return OccupancyGrid(np.zeros((0, 0), np.float32), self._grid.geometry)
        known = visible_cells(
            probability,
            known,
            self._grid.cells(np.array(self._cameras)),
            config.min_range_m / config.resolution_m + MARGIN_CELLS,
            config.advanced.map.surface_m / config.resolution_m,
        )
        rows, cols = np.nonzero(known)
        low, high = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
        corner = self._grid.corner + low
        geometry = GridGeometry(
            config.resolution_m,
            (float(corner[1]) * config.resolution_m, float(corner[0]) * config.resolution_m),
        )
        values = np.where(known, probability, np.nan).astype(np.float32)
        return OccupancyGrid(values[low[0] : high[0], low[1] : high[1]], geometry)

    def layer(self) -> GridLayer:
        """P(occupied) of all cells; the prior in unknown ones."""
        return GridLayer(self.probability().astype(np.float32), self._grid.geometry)

    def _evidence(self, camera: Floats, yaw: float, rays: StereoRays, noise: StereoNoise) -> CellEvidence:
        """The evidence of a frame for the n cells of each of its m rays, `(m, n)` each; `camera` (m) and `yaw` are in the map."""
        config = self._config
        ray_start = self._ray_start(camera)
        per_cell = self.correlation.per_cell(config.resolution_m)
        priors = priors_of_rays(
            self._grid.values[..., 0],
            GridRays(ray_start.origin, rays.bearings + yaw, ray_start.first + 0.5, self._count),
            self._prior,
            per_cell if config.likelihood == "chain" else 0.0,
        )
        first, none = first_likelihoods(rays.disparities_px, rays.focal_baseline, rays.edges_m, noise)
        front_is_empty = config.likelihood == "independent"
        evidence: RayEvidence = likelihoods_of_rays(priors, first, none, front_is_empty)
        expected = expected_behind(evidence.reached, priors.correlation, config.prior)
        strength = config.advanced.correlation.across_rays
        if strength > 0.0:
            ranges = np.asarray(ray_start.first + 0.5 + np.arange(self._count), np.float64)
            evidence = couple_neighbouring_rays(evidence, rays.bearings, ranges, per_cell, strength)
        thickness = min(round(config.advanced.correlation.behind_m / config.resolution_m), self._count)
        reached = evidence.reached
        reached_surface = np.hstack(
            [np.repeat(reached[:, :1], thickness, axis=1), reached[:, : self._count - thickness]]
        )
        return CellEvidence(evidence.occupied, evidence.empty, reached, reached_surface, expected)

    def _ray_start(self, camera: Floats) -> RayStart:
        """The start of the rays from `camera` (m, map frame) in the grid."""
        resolution = self._config.resolution_m
        return RayStart(
            camera / resolution - self._grid.corner[::-1], self._config.min_range_m / resolution, resolution
        )
