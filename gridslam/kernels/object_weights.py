"""Weights of many poses of one object: its footprint intersected with lidar beams, and its tag's visibility to the reader."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

_PARALLEL = 1e-9
_ROOT_TWO_PI = 2.5066282746310002
_MAX_BACKGROUND_SIGMAS = 5.0  # a surface farther from an endpoint than this does not explain it
_MIN_DISTANCE_M = 1e-3  # smallest distance of a tag from the antenna
_MAX_READ_PROBABILITY = 0.99  # keeps the logarithm of a missed read finite


class ObservedBeams(NamedTuple):
    """Beams: `rays` `(m, 4)` are origins and unit directions, `ranges` `(m,)` the readings.

    `background_m` `(m,)` is the distance of each endpoint from the surface that explains it without the object (a wall, another
    object); infinite if there is none.
    """

    rays: NDArray[np.float64]
    ranges: NDArray[np.float64]
    background_m: NDArray[np.float64]


class EndpointMixture(NamedTuple):
    """Density of an endpoint about a surface: normal, and with `random_ratio` uniform with `random_density` (1/m)."""

    sigma_m: float
    random_ratio: float
    random_density: float


class AntennaParameters(NamedTuple):
    """Parameters of `gridslam.sensors.rfid.AntennaModel`."""

    range_m: float
    softness: float
    detection_probability: float
    false_read_probability: float
    hidden_ratio: float
    min_facing: float


class ReaderRounds(NamedTuple):
    """Inventory rounds from `antennas` `(r, 3)`, and the scan `(r,)` that shows what stood around the robot then.

    `profiles` `(s, bins)` are the ranges measured around the `viewpoints` `(s, 3)` of the scans.
    """

    antennas: NDArray[np.float64]
    scan_of_round: NDArray[np.int64]
    viewpoints: NDArray[np.float64]
    profiles: NDArray[np.float64]


@compiled
def intersect_ray(
    corners: NDArray[np.float64], ox: float, oy: float, dx: float, dy: float
) -> tuple[float, float]:
    """Distance along a ray to a closed polygon `(k, 2)`, and the cosine of incidence; (inf, 1) if the ray misses it."""
    best, cosine = np.inf, 1.0
    k = corners.shape[0]
    for i in range(k):
        j = i + 1 if i + 1 < k else 0
        ex, ey = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
        cross = dx * ey - dy * ex
        if abs(cross) < _PARALLEL:
            continue
        wx, wy = corners[i, 0] - ox, corners[i, 1] - oy
        across = wx * dy - wy * dx  # where the ray crosses the edge, from 0 to `cross`
        if (across < 0.0 or across > cross) if cross > 0.0 else (across > 0.0 or across < cross):
            continue
        distance = (wx * ey - wy * ex) / cross
        if 0.0 <= distance < best:
            best, cosine = distance, abs(cross) / np.sqrt(ex * ex + ey * ey)
    return best, cosine


@compiled
def place_footprint(pose: NDArray[np.float64], footprint: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners `(k, 2)` of a footprint at a pose (3,)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    corners = np.empty_like(footprint)
    for i in range(footprint.shape[0]):
        corners[i, 0] = pose[0] + c * footprint[i, 0] - s * footprint[i, 1]
        corners[i, 1] = pose[1] + s * footprint[i, 0] + c * footprint[i, 1]
    return corners


@compiled
def footprint_gains(
    poses: NDArray[np.float64],
    footprint: NDArray[np.float64],
    observed: ObservedBeams,
    mixture: EndpointMixture,
) -> NDArray[np.float64]:
    """log P(L | object at pose) - log P(L | no object) `(n,)`, summed over the beams that meet the footprint `(k, 2)`.

    An endpoint in front of the footprint hides it: that beam counts for neither.
    """
    beams, ranges, background = observed.rays, observed.ranges, observed.background_m
    sigma, random_density = mixture.sigma_m, mixture.random_density
    n, m = poses.shape[0], beams.shape[0]
    peak = (1.0 - mixture.random_ratio) / (_ROOT_TWO_PI * sigma)
    floor = mixture.random_ratio * random_density
    otherwise = np.empty(m)
    for b in range(m):
        if background[b] < _MAX_BACKGROUND_SIGMAS * sigma:
            otherwise[b] = np.log(peak * np.exp(-0.5 * (background[b] / sigma) ** 2) + floor)
        else:
            otherwise[b] = np.log(random_density)
        otherwise[b] = max(otherwise[b], np.log(random_density))
    radius = 0.0
    mx, my = (
        0.5 * (footprint[:, 0].min() + footprint[:, 0].max()),
        0.5 * (footprint[:, 1].min() + footprint[:, 1].max()),
    )
    for i in range(footprint.shape[0]):
        radius = max(radius, np.hypot(footprint[i, 0] - mx, footprint[i, 1] - my))
    gains = np.zeros(n)
    for p in range(n):
        corners = place_footprint(poses[p], footprint)
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        cx, cy = poses[p, 0] + c * mx - s * my, poses[p, 1] + s * mx + c * my
        total = 0.0
        for b in range(m):
            dx, dy = beams[b, 2], beams[b, 3]
            wx, wy = cx - beams[b, 0], cy - beams[b, 1]
            if abs(dx * wy - dy * wx) > radius or dx * wx + dy * wy < -radius:
                continue
            distance, cosine = intersect_ray(corners, beams[b, 0], beams[b, 1], dx, dy)
            if distance == np.inf:
                continue
            error = (ranges[b] - distance) * cosine
            explained = np.log(peak * np.exp(-0.5 * (error / sigma) ** 2) + floor)
            if error < 0.0:
                explained = max(explained, otherwise[b])
            total += explained - otherwise[b]
        gains[p] = total
    return gains


@compiled
def distances_behind(
    corners: NDArray[np.float64], beams: NDArray[np.float64], ranges: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signed distance (m) `(m,)` of each endpoint behind the face of the polygon `(k, 2)` that its beam meets first.

    Negative: the endpoint lies in front of it. Infinite: the beam misses the polygon.
    """
    out = np.full(beams.shape[0], np.inf)
    for b in range(beams.shape[0]):
        distance, cosine = intersect_ray(corners, beams[b, 0], beams[b, 1], beams[b, 2], beams[b, 3])
        if distance < np.inf:
            out[b] = (ranges[b] - distance) * cosine
    return out


@compiled
def tag_log_likelihood(
    tags: NDArray[np.float64],
    rounds: ReaderRounds,
    is_read: NDArray[np.bool_],
    slack_m: float,
    antenna: AntennaParameters,
) -> NDArray[np.float64]:
    """log P(I | tag at pose) `(n,)` for tag poses `(n, 3)`, given which rounds read the tag `(r,)`.

    A tag more than `slack_m` behind the range that a scan measured in its direction is hidden.
    """
    antennas, viewpoints, profiles = rounds.antennas, rounds.viewpoints, rounds.profiles
    range_m, softness = antenna.range_m, antenna.softness
    false_read = antenna.false_read_probability
    bins = profiles.shape[1]
    out = np.zeros(tags.shape[0])
    hidden = np.zeros(viewpoints.shape[0], np.bool_)
    ahead_x, ahead_y = np.cos(antennas[:, 2]), np.sin(antennas[:, 2])
    for p in range(tags.shape[0]):
        normal_x, normal_y = np.cos(tags[p, 2]), np.sin(tags[p, 2])
        for s in range(viewpoints.shape[0]):
            wx, wy = tags[p, 0] - viewpoints[s, 0], tags[p, 1] - viewpoints[s, 1]
            bearing = (np.arctan2(wy, wx) - viewpoints[s, 2]) / (2.0 * np.pi)
            cell = min(int((bearing - np.floor(bearing)) * bins), bins - 1)
            hidden[s] = np.hypot(wx, wy) > profiles[s, cell] + slack_m
        total = 0.0
        for r in range(antennas.shape[0]):
            wx, wy = tags[p, 0] - antennas[r, 0], tags[p, 1] - antennas[r, 1]
            distance = max(np.sqrt(wx * wx + wy * wy), _MIN_DISTANCE_M)
            off = 0.5 * (1.0 + (wx * ahead_x[r] + wy * ahead_y[r]) / distance)
            facing = max(0.5 * (1.0 - (wx * normal_x + wy * normal_y) / distance), antenna.min_facing)
            limit = range_m * off * facing
            chance = antenna.detection_probability / (1.0 + np.exp((distance - limit) / (softness * range_m)))
            if hidden[rounds.scan_of_round[r]]:
                chance *= antenna.hidden_ratio
            chance = min(false_read + (1.0 - false_read) * chance, _MAX_READ_PROBABILITY)
            total += np.log(chance if is_read[r] else 1.0 - chance)
        out[p] = total
    return out


@compiled
def mark_points_on(
    points: NDArray[np.float64], corners: NDArray[np.float64], margin_m: float, marked: NDArray[np.bool_]
) -> None:
    """Mark the points `(m, 2)` that lie within a polygon `(k, 2)` or no farther than `margin_m` from its edges."""
    k = corners.shape[0]
    low_x, high_x = corners[:, 0].min() - margin_m, corners[:, 0].max() + margin_m
    low_y, high_y = corners[:, 1].min() - margin_m, corners[:, 1].max() + margin_m
    for p in range(points.shape[0]):
        x, y = points[p, 0], points[p, 1]
        if marked[p] or x < low_x or x > high_x or y < low_y or y > high_y:
            continue
        inside = False
        for i in range(k):
            j = i + 1 if i + 1 < k else 0
            ax, ay = corners[i, 0], corners[i, 1]
            ex, ey = corners[j, 0] - ax, corners[j, 1] - ay
            square = max(ex * ex + ey * ey, 1e-18)
            fraction = min(max(((x - ax) * ex + (y - ay) * ey) / square, 0.0), 1.0)
            if np.hypot(x - ax - fraction * ex, y - ay - fraction * ey) <= margin_m:
                marked[p] = True
                break
            if (ay > y) != (ay + ey > y) and x < ax + (y - ay) * ex / ey:
                inside = not inside
        if inside:
            marked[p] = True
