"""The front end: matches every scan against a local map of the last key scans.

Two local maps overlap: scans are matched against the older one while the younger one fills; then the younger one takes over
(Hess et al. 2016 arrange submaps in this way). The result is an odometry that has the accuracy of the lidar over short
distances.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.scan_matching import surfel_registration, surfels
from gridslam.kernels.scan_matching.surfel_registration import PosePrior, Registration, YawSearch
from gridslam.lidar_slam.config import OdometryConfig
from gridslam.lidar_slam.odometry_noise import NO_MIN_STD, odometry_std
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]

CELL_M = 0.2  # cell of the local surface maps, with one surface element each
LOCAL_MAP_KEY_SCANS = 30  # a local map is matched against once it has this many
SIGMA_M = 0.05  # scale of the robust loss on point-to-line distances: range noise and uneven walls
# Largest distance of a correspondence in the first iteration: the error of the prediction
MAX_CORRESPONDENCE_M = 0.4
FINAL_CORRESPONDENCE_M = 0.1  # the same in the last iterations: what lies farther away is another surface
MAX_ITERATIONS = 12
MIN_CORRESPONDENCES = 20  # with fewer correspondences the odometry is used
# A direction is open where the normals' root mean square component along it is as small as their noise: below 0.04 along smooth
# walls, above 0.05 in 99 % of the matches of recorded logs. Many beams determine the position all the same
MAX_PARALLEL, OPEN_STD_M = 0.045, 0.04

YAW_STEP_RAD = 0.02  # matching converges from headings that are wrong by this much
YAW_SEARCH_POINTS = 120
YAW_SEARCH_SIGMA_M = 2.0 * SIGMA_M
YAW_SEARCH_CORRESPONDENCE_M = 0.75 * MAX_CORRESPONDENCE_M
YAW_SEARCH_STDS = 2.0  # half width of the search for the heading, in standard deviations of the odometry

MIN_INLIER_RATIO = 0.55  # below this ratio other predictions are tried
RECOVERY_M = 0.3  # how far ahead and behind they lie, and the standard deviation of their position
RECOVERY_RAD = 0.5  # half width of their heading search, and the standard deviation of their heading
WIDE_STDS = 2.0  # half width of the search for position and heading where the position is more uncertain than RECOVERY_M
WIDE_SPACING_M = 0.4  # distance between the positions tried then: matching converges from half of it
# Smallest gain of the inlier ratio by another prediction: a few points more are chance
MIN_RECOVERED_GAIN = 0.2
MIN_RECOVERED_INLIER_RATIO = 0.5

MAX_GAP_RATIO = 2.5  # after a gap of more scan periods than this the velocity is unknown
RECENT_SCANS = 11  # scans since which odometry is compared when it stutters

DIAGONAL = (range(3), range(3))
NO_SEARCH = YawSearch(YAW_STEP_RAD, 0, YAW_SEARCH_POINTS, YAW_SEARCH_SIGMA_M, YAW_SEARCH_CORRESPONDENCE_M)
REGISTRATION = Registration(
    SIGMA_M, MAX_CORRESPONDENCE_M, FINAL_CORRESPONDENCE_M, MAX_ITERATIONS, min_correspondences=0.0
)


@dataclass(frozen=True, slots=True)
class ScanMatch:
    """Pose (3,) in the front end's frame, the fraction of points that lie on a surface, and whether the pose is from matching.

    `weakest_m` is the matched position's standard deviation (m) in the direction in which the surfaces constrain it least (along
    a corridor), as a vector (2,) of that direction in the front end's frame; None where nothing constrains it. `is_open`: they
    are all but parallel to a direction of motion, along a smooth or a round corridor, so that noise decides about it.
    """

    pose: Floats
    inlier_ratio: float
    is_matched: bool
    weakest_m: Floats | None = None
    is_open: bool = False

    @property
    def position_std_m(self) -> float:
        """Standard deviation (m) of the matched position in its least certain direction."""
        return math.inf if self.weakest_m is None else math.hypot(*self.weakest_m.tolist())


class Tracking(Protocol):
    """Interface of a tracker, which follows the robot from scan to scan; its frame drifts relative to the map's."""

    @property
    def pose(self) -> Floats:
        """T_track_base (3,) at the last scan."""

    def track(self, scan: PreparedScan, odometry: Floats, min_std: Floats = NO_MIN_STD) -> ScanMatch:
        """The pose at a scan, given T_odom_base (3,) at its stamp; the first scan is at the origin.

        The odometry's motion since the last scan has standard deviations (x, y, yaw) of at least `min_std` (3,).
        """

    def add_key_scan(self, scan: PreparedScan) -> None:
        """Insert the last tracked scan at its pose: later scans are matched against it."""


@dataclass(frozen=True, slots=True)
class _TrackedPose:
    """Poses (3,) by odometry and by matching at one scan."""

    stamp_ns: int
    odometry: Floats
    pose: Floats


class FrontEnd:
    """Tracks the robot from scan to scan against surface maps; its frame drifts relative to the map's."""

    def __init__(self, odometry: OdometryConfig, memory_limit_mb: float) -> None:
        self._odometry = odometry
        self._store = TileStore(2, surfels.CHANNELS, CELL_M, memory_limit_mb)
        self._active = 0
        self._key_scan_counts = [0, 0]
        self._recent: deque[_TrackedPose] = deque(maxlen=RECENT_SCANS)
        self.pose = np.zeros(3)

    def track(self, scan: PreparedScan, odometry: Floats, min_std: Floats = NO_MIN_STD) -> ScanMatch:
        """The pose at the scan, given T_odom_base `(3,)` at its stamp; the first scan is at the origin.

        The odometry's motion since the last scan has standard deviations (x, y, yaw) of at least `min_std` `(3,)`.
        """
        first = ScanMatch(self.pose, 1.0, True)
        match = self._match(scan, odometry, min_std) if self._recent else first
        self.pose = match.pose
        self._recent.append(_TrackedPose(scan.stamp_ns, odometry, match.pose))
        return match

    def add_key_scan(self, scan: PreparedScan) -> None:
        """Insert the scan at the present pose into the local maps."""
        active, other = self._active, 1 - self._active
        self._insert(active, scan)
        if self._key_scan_counts[active] >= LOCAL_MAP_KEY_SCANS:
            self._insert(other, scan)
        if self._key_scan_counts[other] >= LOCAL_MAP_KEY_SCANS:
            self._store.clear(active)
            self._key_scan_counts[active] = 0
            self._active = other

    def _match(self, scan: PreparedScan, odometry: Floats, min_std: Floats) -> ScanMatch:
        """Match the scan from the predicted pose, and from other predictions if that fails."""
        step = se2.between(self._recent[-1].odometry, odometry)
        steady = self._motion_at_constant_velocity(scan.stamp_ns, step)
        std = odometry_std(step, steady, self._odometry, min_std)
        predicted = se2.compose(self.pose, step)
        search = _yaw_search(YAW_SEARCH_STDS * float(std[2]) - YAW_STEP_RAD)
        match = self._register(scan, predicted, std, search)
        if match.inlier_ratio < MIN_INLIER_RATIO and len(scan.points) >= MIN_CORRESPONDENCES:
            guesses, window_rad = self._other_predictions(odometry, predicted, steady), RECOVERY_RAD
            if std[0] > RECOVERY_M:
                guesses += _positions_around(predicted, WIDE_STDS * float(std[0]))
                window_rad = max(RECOVERY_RAD, min(WIDE_STDS * float(std[2]), np.pi))
            match = self._recover(scan, guesses, window_rad, match)
        return match

    def _motion_at_constant_velocity(self, stamp_ns: int, step: Floats) -> Floats:
        """The motion since the last scan if the robot has kept its velocity; `step` itself after a gap in the scans."""
        if len(self._recent) < 2:
            return step
        before, last = self._recent[-2], self._recent[-1]
        elapsed = last.stamp_ns - before.stamp_ns
        ratio = (stamp_ns - last.stamp_ns) / elapsed if elapsed > 0 else np.inf
        if not 0.0 < ratio < MAX_GAP_RATIO:
            return step
        return np.asarray(se2.between(before.pose, last.pose) * ratio)

    def _other_predictions(self, odometry: Floats, predicted: Floats, steady: Floats) -> list[Floats]:
        """Other poses `(3,)` to start from, for odometry that has stuttered: in real logs it freezes and then catches up.

        These are: the last velocity (right while the odometry is frozen), the odometry since several scans ago (right after it
        has caught up), and positions ahead and behind.
        """
        guesses = [predicted, se2.compose(self.pose, steady)]
        earlier = (self._recent[0], self._recent[len(self._recent) // 2])
        guesses += [se2.compose(then.pose, se2.between(then.odometry, odometry)) for then in earlier]
        guesses += [
            se2.compose(predicted, np.array([ahead, 0.0, 0.0])) for ahead in (-RECOVERY_M, RECOVERY_M)
        ]
        return [np.asarray(guess) for guess in guesses]

    def _register(
        self, scan: PreparedScan, predicted: Floats, std: Floats, search: YawSearch = NO_SEARCH
    ) -> ScanMatch:
        """Register the scan in the active map, with the prediction and its standard deviations as prior.

        It starts from the prediction, or from its best heading within the search's steps.
        """
        information = np.zeros((3, 3))
        information[DIAGONAL] = 1.0 / std**2
        prior = PosePrior(predicted, information)
        pose, scan_information, used = surfel_registration.match_scan(
            self._store.map(self._active), scan.matching_points, prior, search, REGISTRATION
        )
        if used < MIN_CORRESPONDENCES:
            return ScanMatch(predicted, 0.0, False)
        pose[2] = se2.wrap_angle(float(pose[2]))
        inliers, weakest = used / len(scan.points), _weakest(scan_information)
        return ScanMatch(pose, inliers, True, weakest, _is_open(scan_information))

    def _recover(
        self, scan: PreparedScan, guesses: Sequence[Floats], window_rad: float, poor: ScanMatch
    ) -> ScanMatch:
        """The best match from all guesses, after a search for the heading at each; `poor` if none is clearly better."""
        best = poor
        std = np.array([RECOVERY_M, RECOVERY_M, RECOVERY_RAD])
        threshold = max(poor.inlier_ratio + MIN_RECOVERED_GAIN, MIN_RECOVERED_INLIER_RATIO)
        for guess in guesses:
            match = self._register(scan, self._with_best_yaw(scan, guess, window_rad), std)
            if match.inlier_ratio > max(best.inlier_ratio, threshold):
                best = match
        return best

    def _with_best_yaw(self, scan: PreparedScan, predicted: Floats, window_rad: float) -> Floats:
        """The predicted pose with the best heading within +-window."""
        points = scan.subset(YAW_SEARCH_POINTS)
        surfaces = self._store.map(self._active)
        return np.asarray(
            surfel_registration.search_yaw(surfaces, points, predicted, _yaw_search(window_rad))
        )

    def _insert(self, index: int, scan: PreparedScan) -> None:
        self._store.own_endpoints(np.array([index]), self.pose[None], scan.surface)
        surfels.insert_surfels(self._store.map(index), self.pose, scan.surface_points)
        self._key_scan_counts[index] += 1


def _weakest(information: Floats) -> Floats | None:
    """Standard deviation (m) of a position in its least certain direction, as a vector (2,), given the pose's information."""
    (xx, xy, _), (_, yy, _), _ = information.tolist()
    smaller, _ = _eigenvalues(xx, xy, yy)
    if smaller <= 0.0:
        return None
    direction = 0.5 * (math.atan2(2.0 * xy, xx - yy) + math.pi)
    return np.array([math.cos(direction), math.sin(direction)]) / math.sqrt(smaller)


def _is_open(information: Floats) -> bool:
    """Whether a pose's information `(3, 3)` leaves its position open in a direction, at whatever heading."""
    (xx, xy, x_yaw), (_, yy, y_yaw), (_, _, yaw) = information.tolist()
    if yaw <= 0.0:
        return True
    _, larger = _eigenvalues(xx, xy, yy)
    smaller, _ = _eigenvalues(xx - x_yaw * x_yaw / yaw, xy - x_yaw * y_yaw / yaw, yy - y_yaw * y_yaw / yaw)
    return bool(smaller < min(OPEN_STD_M**-2.0, MAX_PARALLEL**2 * larger))


def _eigenvalues(xx: float, xy: float, yy: float) -> tuple[float, float]:
    """The smaller and the larger eigenvalue of a symmetric 2 x 2 matrix."""
    mean, radius = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return mean - radius, mean + radius


def _yaw_search(window_rad: float) -> YawSearch:
    """A search for the heading within +-window; of no steps if matching converges without a search."""
    if window_rad <= 0.0:
        return NO_SEARCH
    return NO_SEARCH._replace(steps=max(math.ceil(window_rad / YAW_STEP_RAD), 0))


def _positions_around(pose: Floats, radius_m: float) -> list[Floats]:
    """Poses `(3,)` with the heading of `pose` on a square grid within a radius about it."""
    steps = np.arange(1, int(radius_m / WIDE_SPACING_M) + 1) * WIDE_SPACING_M
    offsets = np.concatenate([-steps[::-1], [0.0], steps])
    return [
        np.array([pose[0] + dx, pose[1] + dy, pose[2]])
        for dx in offsets
        for dy in offsets
        if 0.0 < np.hypot(dx, dy) <= radius_m
    ]
