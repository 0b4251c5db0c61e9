"""Without a start pose: the whole drawing is searched at many scales for where the first scan could have been seen from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.maps.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.sensors.likelihood_field import distance_field, log_likelihood_table
from gridslam.sensors.pose_search import PoseSearch, SearchSettings
from gridslam.sensors.range_caster import range_caster

Floats = NDArray[np.float64]

REACH_SIGMAS = 4.0
RANGE_SIGMA = 0.25  # of the logarithm of a range: drawings err in proportion
RANGE_SPAN = 1.5  # larger differences of the logarithm count alike: doors, furniture
SCATTER = np.array([0.15, 0.15, 0.05, 0.04, 0.04])  # about a hypothesis: metres of the world, rad, log scales


def search_states(
    drawn: DrawnMap, points: Floats, config: HandmapSlamConfig, rng: np.random.Generator
) -> Floats:
    """States `(n, 5)` (x, y, yaw, log scales) about the best hypotheses over all places, headings and scales."""
    settings, search = config.localization, config.search
    low, high = settings.scale_range
    if settings.scale is not None:
        spread = np.exp(2.0 * settings.scale_deviation)
        low, high = settings.scale / spread, settings.scale * spread
    scales = np.geomspace(low, high, search.scales)
    hypotheses = np.concatenate([_at_scale(drawn, points, config, float(scale)) for scale in scales])
    scores = _range_scores(drawn, points, hypotheses)
    weights = np.exp(scores - scores.max())
    n = settings.start_particles
    states = hypotheses[systematic_resampling(weights, n, rng)]
    scatter = rng.standard_normal((n, 5)) * SCATTER
    scatter[:, :2] *= np.exp(states[:, 3:4])
    if not settings.separate_scales:
        scatter[:, 4] = scatter[:, 3]
    states = states + scatter
    states[:, 2] = se2.wrap_angle(states[:, 2])
    return np.asarray(states)


def _at_scale(drawn: DrawnMap, points: Floats, config: HandmapSlamConfig, scale: float) -> Floats:
    """The best states `(k, 5)` if the drawing has this scale."""
    settings, search = config.localization, config.search
    sigma = settings.sigma_m * scale
    field = distance_field(drawn.walls, drawn.geometry, REACH_SIGMAS * sigma)
    grain = SearchSettings(
        search.spacing_m * scale,
        search.headings,
        sigma,
        search.points,
        search.most_poses,
        search.refined,
        search.hypotheses,
        apart_m=0.5 * scale,
        apart_rad=0.26,
    )
    table = log_likelihood_table(field, sigma, settings.random_share)
    found = PoseSearch(field, drawn.free, grain).best(points * scale, table)
    return np.column_stack([found.poses, np.full((len(found.poses), 2), np.log(scale))])


def _range_scores(drawn: DrawnMap, points: Floats, states: Floats) -> Floats:
    """Log-likelihoods `(n,)` of what the ranges would be in the drawing against what they are.

    End points near walls alone would favour small scales, at which a scan hides in a corner; a ray that would have had to
    pass a drawn wall, or that stops in the open, speaks against them.
    """
    caster = range_caster(drawn.walls, drawn.geometry)
    bearings, ranges = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    reach = float(np.hypot(*drawn.walls.shape)) * drawn.geometry.resolution_m
    expected = caster.ranges(states[:, :3], bearings, np.zeros(3), reach).astype(np.float64)
    with np.errstate(divide="ignore"):
        off = np.log(np.maximum(expected, drawn.geometry.resolution_m)) - np.log(ranges) - states[:, 3:4]
    return np.asarray(
        -0.5 * np.minimum((off / RANGE_SIGMA) ** 2, RANGE_SPAN**2 / RANGE_SIGMA**2).mean(axis=1) * 10.0
    )
