"""Global localization: without a start pose, the whole drawing is searched at many scales for the pose of the first scan.

Scales are drawing units per metre. Maps of the drawing have drawing units where other maps have metres, so a field called
`..._m` of `geometry` or `PoseSearchSettings` is in drawing units here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import scattered
from gridslam.methods.handmap_slam.drawn_likelihood import MAX_DISTANCE_SIGMAS, OUTLIER_FRACTION
from gridslam.sensors.likelihood_field import distance_field, log_likelihood_table
from gridslam.sensors.pose_search import PoseSearch, PoseSearchSettings
from gridslam.sensors.range_caster import range_caster

Floats = NDArray[np.float64]

SCALE_STD = 0.1  # relative standard deviation of a scale given by the user
SCALE_STDS = 2.0  # half width of the search around a given scale, in standard deviations
SCALES = 17  # number of scales tried, evenly spaced in log scale
SPACING_M = 0.4  # distance between the positions tried, in metres of the world
HEADINGS = 72  # number of headings tried at each position
COARSE_POINTS = 60  # number of scan points used in the exhaustive stage
MAX_POSES = 300_000  # largest number of poses tried at each scale; on larger drawings the spacing grows
REFINED_POSES = 300  # number of poses refined at each scale
HYPOTHESES = 60  # largest number of hypotheses kept at each scale
SAME_POSE_M, SAME_POSE_RAD = 0.5, 0.26  # hypotheses closer than this count as one

RANGE_SIGMA = 0.25  # standard deviation of a log range: errors of drawings are proportional to length
MAX_RANGE_ERROR = 1.5  # larger errors of a log range are cut to this: doors and furniture are not drawn
RANGE_WEIGHT = 10.0  # number of independent ranges that a scan counts as
SCATTER = np.array([0.15, 0.15, 0.05, 0.04, 0.04])  # std about a hypothesis: x, y (m), yaw (rad), log scales


def search_states(
    drawn: DrawnMap, points: Floats, config: HandmapSlamConfig, count: int, rng: np.random.Generator
) -> Floats:
    """States `(count, 5)` (x, y, yaw, log scales) around the best hypotheses over all places, headings and scales.

    `points` `(m, 2)` are those of the first scan (robot's frame, m).
    """
    settings = config.localization
    low, high = settings.scale_range
    if settings.scale is not None:
        factor = np.exp(SCALE_STDS * SCALE_STD)
        low, high = settings.scale / factor, settings.scale * factor
    scales = np.geomspace(low, high, SCALES)
    hypotheses = np.concatenate(
        [_hypotheses_at(float(scale), drawn, points, settings.sigma_m) for scale in scales]
    )
    scores = _range_scores(drawn, points, hypotheses)
    weights = np.exp(scores - scores.max())
    states = hypotheses[systematic_resampling(weights, count, rng)]
    states = scattered(states, SCATTER, rng, separate_scales=settings.separate_scales)
    states[:, 2] = se2.wrap_angle(states[:, 2])
    return np.asarray(states)


def _hypotheses_at(scale: float, drawn: DrawnMap, points: Floats, sigma_m: float) -> Floats:
    """The best states `(k, 5)` at one scale of the drawing."""
    sigma = sigma_m * scale
    field = distance_field(drawn.walls, drawn.geometry, MAX_DISTANCE_SIGMAS * sigma)
    search_settings = PoseSearchSettings(
        spacing_m=SPACING_M * scale,
        headings=HEADINGS,
        sigma_m=sigma,
        points=COARSE_POINTS,
        max_poses=MAX_POSES,
        refined=REFINED_POSES,
        hypotheses=HYPOTHESES,
        bin_m=SAME_POSE_M * scale,
        bin_rad=SAME_POSE_RAD,
    )
    table = log_likelihood_table(field, sigma, OUTLIER_FRACTION)
    found = PoseSearch(field, drawn.free, search_settings).search(points * scale, table)
    return np.column_stack([found.poses, np.full((len(found.poses), 2), np.log(scale))])


def _range_scores(drawn: DrawnMap, points: Floats, states: Floats) -> Floats:
    """Log-likelihoods `(n,)` of the measured ranges, given those ray cast in the drawing from the states `(n, 5)`.

    Without this term small scales would win, because a shrunken scan fits into any corner. Rays that pass through a drawn
    wall, or end in the open, count against such a state. Both scales of a state must be equal.
    """
    caster = range_caster(drawn.walls, drawn.geometry)
    bearings, ranges = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    max_range = float(np.hypot(*drawn.walls.shape)) * drawn.geometry.resolution_m
    expected = caster.ranges(states[:, :3], bearings, np.zeros(3), max_range).astype(np.float64)
    with np.errstate(divide="ignore"):  # a range of 0 has an infinite error, which is cut below
        error = np.log(np.maximum(expected, drawn.geometry.resolution_m)) - np.log(ranges) - states[:, 3:4]
    squared = np.minimum((error / RANGE_SIGMA) ** 2, MAX_RANGE_ERROR**2 / RANGE_SIGMA**2)
    return np.asarray(-0.5 * squared.mean(axis=1) * RANGE_WEIGHT)
