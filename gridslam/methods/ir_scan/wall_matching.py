"""A match by search over shift and rotation with the odometry as prior, refined on the lines of the walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared.infrared_beams import shifted_sums, splat_maximum
from gridslam.kernels.infrared.wall_lines import MapPoints
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.methods.ir_scan.lines import WallMoments
from gridslam.methods.ir_scan.stops import MeasuredPose, StopMatch
from gridslam.sensors.infrared import RangeNoise, ReliableReadings

Floats = NDArray[np.float64]

KERNEL_STD_M = 0.02  # standard deviation of a reading about its wall in the search; at least a cell
KERNEL_SIGMAS = 3.0  # radius of the kernel, in standard deviations
POINT_LOG_LIKELIHOOD = 0.3  # of a point on a wall; below 1 because neighbouring points have similar errors
MIN_PRIOR_VARIANCE = np.array([0.004, 0.004, 0.004]) ** 2  # m^2, m^2, rad^2; added to that of the prediction
WALL_THICKNESS_RATIO = 0.4  # largest thickness of a wall segment, as a fraction of the window
CELLS_PER_WINDOW = 3.0  # along each side
MAX_STEPS = 12  # largest number of Gauss-Newton steps
CONVERGED = 2e-4  # largest change of any coordinate (m, rad)


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of `WallMatcher`; see `MatchingConfig` and `AdvancedMatching`."""

    window_cells: int = 10
    rotation_rad: float = 0.06
    min_points: int = 10
    max_position_std_m: float = 0.04


@dataclass(frozen=True, slots=True)
class PoseSearchResult:
    """The best pose of the window `(3,)`, the position's standard deviation over the window (m), and the best sum per reading."""

    pose: Floats
    position_std_m: float
    score: float


class WallMatcher:
    """A map for matching: a grid of blurred readings for the search, and the lines of walls for the refinement.

    Walls are fitted in windows of `window_m`; the grid has cells of `resolution_m`. Grid and walls may take up to
    `memory_limit_mb` each.
    """

    def __init__(
        self,
        settings: SearchSettings,
        noise: RangeNoise,
        *,
        resolution_m: float,
        window_m: float,
        memory_limit_mb: float,
    ) -> None:
        self._settings, self._noise = settings, noise
        self._max_thickness_m = WALL_THICKNESS_RATIO * window_m
        self._blurred = GrowingGrid(resolution_m, memory_limit_mb)
        self._walls = WallMoments(window_m / CELLS_PER_WINDOW, memory_limit_mb)
        sigma = max(KERNEL_STD_M, resolution_m) / resolution_m
        offsets = np.arange(-int(KERNEL_SIGMAS * sigma), int(KERNEL_SIGMAS * sigma) + 1)
        self._kernel = np.exp(-0.5 * (offsets[:, None] ** 2 + offsets[None, :] ** 2) / sigma**2)

    def add(self, points: Floats, weights: Floats) -> None:
        """Add points of walls `(n, 2)` (m, map frame); `weights` `(n,)` are their weights in the fits of lines."""
        if not len(points):
            return
        self._blurred.cover(points, len(self._kernel) // 2)
        cells = self._blurred.cells(points)
        splat_maximum(self._blurred.values, cells, self._kernel, np.ones(len(points)))
        self._walls.add(points, weights)

    def match(self, readings: ReliableReadings, prior: StopMatch) -> StopMatch:
        """The match of a scan near the predicted pose `prior`; an ambiguous match is refused."""
        pose, covariance = prior.pose, prior.covariance
        if len(readings) < self._settings.min_points:
            return StopMatch(pose, covariance, "too_few_points")
        if not self._blurred.values.size:
            return StopMatch(pose, covariance, "first")
        widened = MeasuredPose(pose, covariance + np.diag(MIN_PRIOR_VARIANCE))
        found = self.search(readings, widened)
        if found.score <= 0.0:
            return StopMatch(pose, covariance, "no_match")
        if found.position_std_m > self._settings.max_position_std_m:
            return StopMatch(pose, covariance, "ambiguous", found.score)
        refined, on_walls = self.refine(readings, found.pose, widened)
        if on_walls < self._settings.min_points:
            return StopMatch(pose, covariance, "no_match", found.score)
        return StopMatch(refined.pose, refined.covariance, "matched", found.score)

    def search(self, readings: ReliableReadings, prior: MeasuredPose) -> PoseSearchResult:
        """The most likely pose in the window of shifts and rotations around `prior`."""
        settings, resolution = self._settings, self._blurred.resolution_m
        max_range = max(float(np.hypot(*readings.points.T).max()), resolution)
        count = int(np.ceil(settings.rotation_rad * max_range / resolution))
        rotations = np.linspace(-settings.rotation_rad, settings.rotation_rad, 2 * count + 1)
        if not count:
            rotations = np.zeros(1)
        sums = np.empty((len(rotations), *[2 * settings.window_cells + 1] * 2))
        for k, rotation in enumerate(rotations.tolist()):
            points = readings.in_map(prior.pose + np.array([0.0, 0.0, rotation]))
            sums[k] = shifted_sums(self._blurred.values, self._blurred.cells(points), settings.window_cells)
        shifts = np.asarray(
            resolution * np.arange(-settings.window_cells, settings.window_cells + 1), np.float64
        )
        information: Floats = np.asarray(np.linalg.inv(prior.covariance), np.float64)
        score = POINT_LOG_LIKELIHOOD * sums - 0.5 * _squared_distances(information, rotations, shifts)
        best = np.unravel_index(int(np.argmax(score)), score.shape)
        weight = np.exp(score - score[best]).sum(axis=0)  # of each shift, over all rotations
        weight /= weight.sum()
        offset = np.array([shifts[best[2]], shifts[best[1]], rotations[best[0]]])
        return PoseSearchResult(
            prior.pose + offset, _position_std(weight, shifts), float(sums[best]) / len(readings)
        )

    def refine(
        self, readings: ReliableReadings, start: Floats, prior: MeasuredPose
    ) -> tuple[MeasuredPose, int]:
        """Gauss-Newton from the pose `start` `(3,)`, which moves the readings onto the lines of their walls.

        The odometry is the `prior`.
        Returns the pose with its covariance, and the number of readings on walls.
        """
        information = np.linalg.inv(prior.covariance)
        variances = np.column_stack(self._noise.variances(readings.ranges_m))
        pose, hessian, on_walls = start.copy(), information, 0
        for _ in range(MAX_STEPS):
            rotation = np.array([0.0, 0.0, pose[2]])
            beams = MapPoints(
                se2.transform_points(rotation, readings.points),
                se2.transform_points(rotation, readings.directions),
                variances,
            )
            of_walls, gradient, on_walls = self._walls.equations(pose[:2], beams, self._max_thickness_m)
            offset = pose - prior.pose
            offset[2] = float(se2.wrap_angle(offset[2]))
            hessian = information + of_walls
            step = -np.linalg.solve(hessian, gradient + information @ offset)
            pose = pose + step
            if np.abs(step).max() < CONVERGED:
                break
        return MeasuredPose(pose, np.linalg.inv(hessian)), on_walls


def _position_std(weight: Floats, shifts: Floats) -> float:
    """Standard deviation (m) of the position, given the weight `(y, x)` of each pair of `shifts` (m)."""
    squares = shifts**2
    mean_x, mean_y = float(weight.sum(axis=0) @ shifts), float(weight.sum(axis=1) @ shifts)
    variance = weight.sum(axis=0) @ squares + weight.sum(axis=1) @ squares - mean_x**2 - mean_y**2
    return math.sqrt(max(float(variance), 0.0))


def _squared_distances(information: Floats, rotations: Floats, shifts: Floats) -> Floats:
    """Squared Mahalanobis distances `(rotations, y, x)` of all offsets (x, y, rotation) with x and y from `shifts`."""
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = information.tolist()
    x, y = shifts[None, :], shifts[:, None]
    flat = xx * x**2 + 2.0 * xy * x * y + yy * y**2
    tilted = 2.0 * (xt * x + yt * y)
    return np.asarray(flat + rotations[:, None, None] * tilted + (tt * rotations**2)[:, None, None])
