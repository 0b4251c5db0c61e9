"""Sway of a robot that rolls and pitches: its lidar swings about the path that its wheels measure.

Matching follows the lidar, so the map is right, and the trajectory is that of the lidar. Odometry shows the robot's own path over
times of seconds. The tilt follows from the lidar's height, and levels the scans.
"""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A Gaussian over time about each scan: robots sway within a few seconds, and odometry is good over some seconds
SIGMA_S, HALF_WINDOW_S = 2.0, 5.0
SPACING_S = 0.1  # time between the scans that are compared with each other
MIN_SUPPORT = 0.4  # smallest weight of these, relative to scans without end: at the ends of a log it is half
MAX_ODOMETRY_GAP_S = 0.3  # largest gap of the odometry over which its path is interpolated
UNUSED = -1
MIN_SCANS = 100
WINDOW_S = 5.0
MIN_SWING_M = 0.012  # smallest median swing of windows: matching and odometry of recorded logs differ by less
# Smallest correlation of the swings of successive scans: matching that slides and jittering stamps are less steady
MIN_CORRELATION = 0.75
UNEVEN_S = 0.5  # time over which changes of motion are compared
# By how much the lidar's path must be less even than that of the wheels, relative to their difference: bad odometry is less
# even itself
MIN_UNEVENNESS = 0.75
MAX_SWING_M = 0.3  # odometry that departs by more has slipped
MIN_HEIGHT_M = 0.1  # a lidar that is lower has no known height, or its base is not on the floor
FLOOR_M = 0.2  # beams that end below this height, or half the lidar's, have met the floor
DOUBTED_SWING_M = 0.06  # the map of scans that swing by more, and cannot be levelled, is doubted


@dataclass(frozen=True, slots=True)
class Sway:
    """`shifts_m` `(n, 2)` from the robot to where its lidar has swung, in the robot's frame at each scan; zero where unknown."""

    shifts_m: Floats
    swing_m: float  # root mean square of the shifts
    is_levelled: bool = False

    @property
    def note(self) -> str:
        """One line for the user."""
        levelled = (
            ", and its scans are levelled by that"
            if self.is_levelled
            else "; its scans are not levelled (that needs the height of a planar lidar, log.extrinsics with z, or an IMU)"
        )
        return (
            f"the robot rolls and pitches: its lidar swings by {self.swing_m:.3f} m about the path by odometry, which the "
            f"trajectory follows{levelled}"
        )

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the map; None without one."""
        return None if self.is_levelled or self.swing_m < DOUBTED_SWING_M else self.note

    def removed_from(self, poses: Floats) -> Floats:
        """The poses `(n, 3)` of all scans without the sway."""
        return without_swing(poses, self.shifts_m)


class SwayObserver:
    """Collects the odometry of each scan, and finds the sway at the end of a log."""

    def __init__(self) -> None:
        self._odometry_ns = array("q")
        self._odometry = array("d")  # of each scan: x, y and yaw
        # Of each scan: the number of jumps of the odometry before; UNUSED where it says nothing
        self._parts = array("q")
        self._jumps = 0

    def add_odometry(self, stamp_ns: int) -> None:
        """Add the stamp of an odometry message."""
        self._odometry_ns.append(stamp_ns)

    def add_scan(self, odometry: Floats, has_jumped: bool, is_used: bool) -> None:
        """Add T_odom_base `(3,)` at a scan, whether it jumped since the scan before, and whether both can be compared."""
        self._jumps += has_jumped
        self._odometry.extend(odometry.tolist())
        self._parts.append(self._jumps if is_used else UNUSED)

    def sway_of(self, stamps_ns: Ints, track: Floats) -> Sway | None:
        """The sway of the path `(n, 3)` over all scans by matching; None if there is none, or no odometry shows it."""
        parts = np.array(self._parts, np.int64)
        if len(self._odometry_ns) < 2 or (parts != UNUSED).sum() < MIN_SCANS:
            return None
        gap_s = _gaps_around(stamps_ns, np.sort(np.array(self._odometry_ns, np.int64)))
        parts[gap_s > MAX_ODOMETRY_GAP_S] = UNUSED
        odometry = np.array(self._odometry).reshape(-1, 3)
        return find_sway((stamps_ns - stamps_ns[0]) * 1e-9, track, odometry, parts)


def find_sway(times_s: Floats, track: Floats, odometry: Floats, parts: Ints) -> Sway | None:
    """The sway of a path `track` `(n, 3)` about that of the wheels, `odometry` `(n, 3)`; None if there is none.

    Odometry is compared within `parts` `(n,)` of it, and not where these are UNUSED.
    """
    offsets = _without_calibration_errors(_offsets(times_s, track, odometry, parts))
    is_known = np.isfinite(offsets[:, 0])
    shifts = -np.where(is_known[:, None], offsets, 0.0)
    square_m2 = (shifts**2).sum(axis=1)
    if is_known.sum() < MIN_SCANS or _median_swing_m(times_s[is_known], square_m2[is_known]) < MIN_SWING_M:
        return None
    correlation = float((shifts[1:] * shifts[:-1]).sum() / square_m2.sum())
    if correlation < MIN_CORRELATION or _unevenness(times_s, track, odometry, parts) < MIN_UNEVENNESS:
        return None
    size_m = np.sqrt(square_m2)
    shifts *= np.minimum(1.0, MAX_SWING_M / np.maximum(size_m, MAX_SWING_M))[:, None]
    return Sway(shifts, math.sqrt(float(square_m2[is_known].mean())))


def without_swing(poses: Floats, shifts_m: Floats) -> Floats:
    """The poses `(n, 3)` of a robot whose lidar has swung from these by `shifts_m` `(n, 2)`, in the robot's frame."""
    return np.asarray(se2.compose(poses, np.pad(-shifts_m, ((0, 0), (0, 1)))))


def levelled(scan: PreparedScan, shift_m: Floats, height_m: float) -> PreparedScan:
    """The scan of a planar lidar `height_m` above the floor that has swung by `shift_m` `(2,)`, about the floor below it.

    Beams that met the floor are left out; ranges become horizontal distances.
    """
    min_height_m = min(0.5 * height_m, FLOOR_M)

    def kept_and_scaled(points: Floats) -> tuple[Bools, Floats]:
        rays = points - scan.viewpoint
        drop_m = rays @ shift_m / height_m
        slope = drop_m / np.maximum(np.hypot(*rays.T), 1e-9)
        kept = drop_m < height_m - min_height_m
        return kept, scan.viewpoint + (rays * (1.0 - 0.5 * slope**2)[:, None])[kept]

    _, returns = kept_and_scaled(scan.returns)
    is_point, points = kept_and_scaled(scan.points)
    is_surface, surface = kept_and_scaled(scan.surface)
    return replace(
        scan,
        returns=returns,
        points=points,
        normals=scan.normals[is_point],
        surface=surface,
        surface_normals=scan.surface_normals[is_surface],
    )


def _gaps_around(stamps_ns: Ints, odometry_ns: Ints) -> Floats:
    """Time (s) `(n,)` between the odometry before and after each stamp."""
    after = np.clip(np.searchsorted(odometry_ns, stamps_ns), 1, len(odometry_ns) - 1)
    return np.asarray((odometry_ns[after] - odometry_ns[after - 1]) * 1e-9)


def _offsets(times_s: Floats, track: Floats, odometry: Floats, parts: Ints) -> Floats:
    """Offsets from each pose of the track to where those around it have it by odometry, in its frame; NaN where few are around.

    Of `(n, 4, 2)` the first are the offsets, the others their derivatives by the lidar's true place (x, y) in the frame
    that its extrinsics give, and by the scale of the odometry. All are values of lines over time at the pose's own time.
    """
    n = len(times_s)
    period_s = max(float(np.median(np.diff(times_s))), 1e-3)
    step = max(1, round(SPACING_S / period_s))
    count = int(HALF_WINDOW_S / period_s) // step
    weights, sums = np.zeros((3, n)), np.zeros((2, n, 4, 2))
    for shift in range(-count * step, count * step + 1, step):
        at = np.arange(max(0, -shift), min(n, n - shift))
        at = at[(parts[at] == parts[at + shift]) & (parts[at] != UNUSED)]
        other = at + shift
        lag_s = times_s[other] - times_s[at]
        weight = np.exp(-0.5 * (lag_s / SIGMA_S) ** 2) * (np.abs(lag_s) <= HALF_WINDOW_S)
        matched = se2.between(track[at], track[other])
        expected = se2.compose(matched, se2.between(odometry[other], odometry[at]))[:, :2]
        cos, sin = np.cos(matched[:, 2]) - 1.0, np.sin(matched[:, 2])
        of_place = np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)
        values = np.stack([expected, *of_place, expected - matched[:, :2]], axis=1)
        for power in range(3):
            weights[power, at] += weight * lag_s**power
        for power in range(2):
            sums[power, at] += (weight * lag_s**power)[:, None, None] * values
    one, lag, square = weights[:, :, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (square * sums[0] - lag * sums[1]) / (one * square - lag**2)
    found[weights[0] < MIN_SUPPORT * SIGMA_S * math.sqrt(2.0 * math.pi) / (step * period_s)] = np.nan
    return np.asarray(found)


def _without_calibration_errors(found: Floats) -> Floats:
    """The offsets `(n, 2)` of `_offsets` without those that a misplaced lidar and a wrong scale of the odometry explain."""
    offsets, derivatives = found[:, 0], found[:, 1:].transpose(0, 2, 1)
    known = np.isfinite(offsets).all(axis=1)
    errors, *_ = np.linalg.lstsq(derivatives[known].reshape(-1, 3), offsets[known].ravel(), rcond=None)
    return np.asarray(offsets - derivatives @ errors)


def _median_swing_m(times_s: Floats, square_m2: Floats) -> float:
    """The median over windows of the root mean square swing."""
    _, first = np.unique(times_s // WINDOW_S, return_index=True)
    sums, counts = np.add.reduceat(square_m2, first), np.diff([*first, len(square_m2)])
    return float(np.median(np.sqrt(sums / counts)))


def _unevenness(times_s: Floats, track: Floats, odometry: Floats, parts: Ints) -> float:
    """Surplus of the track's changes of motion over the odometry's: 1 if their difference is the track's, -1 if it is not."""
    step = max(1, round(UNEVEN_S / float(np.median(np.diff(times_s)))))
    middle = np.arange(step, len(times_s) - step)
    before, after = middle - step, middle + step
    is_whole = (parts[before] == parts[after]) & (parts[middle] != UNUSED) & (parts[before] != UNUSED)
    is_whole &= times_s[after] - times_s[before] < 4.0 * UNEVEN_S
    rows = np.column_stack([before, middle, after])[is_whole]
    by_track, by_odometry = (_changes(path[rows]) for path in (track, odometry))
    difference = float(((by_track - by_odometry) ** 2).sum())
    return float((by_track**2).sum() - (by_odometry**2).sum()) / max(difference, 1e-9)


def _changes(poses: Floats) -> Floats:
    """Changes of motion (m) `(n, 2)` at the second of three poses `(n, 3, 3)`, in its frame."""
    ahead, behind = (se2.between(poses[:, 1], poses[:, k])[:, :2] for k in (2, 0))
    return np.asarray(ahead + behind)
