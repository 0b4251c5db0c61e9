"""Weights of many poses of one object: its outline traced into scans, and its tag's visibility from the reader."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

_PARALLEL = 1e-9
_ROOT_TWO_PI = 2.5066282746310002


@compiled
def trace_outline(
    corners: NDArray[np.float64], ox: float, oy: float, dx: float, dy: float
) -> tuple[float, float]:
    """Distance along a ray to a closed polygon `(k, 2)`, and the cosine of incidence; (inf, 1) when it passes by."""
    best, cosine = np.inf, 1.0
    k = corners.shape[0]
    for i in range(k):
        j = i + 1 if i + 1 < k else 0
        ex, ey = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
        cross = dx * ey - dy * ex
        if abs(cross) < _PARALLEL:
            continue
        wx, wy = corners[i, 0] - ox, corners[i, 1] - oy
        across = wx * dy - wy * dx  # times the edge's length: how far along it the ray crosses
        if (across < 0.0 or across > cross) if cross > 0.0 else (across > 0.0 or across < cross):
            continue
        distance = (wx * ey - wy * ex) / cross
        if 0.0 <= distance < best:
            best, cosine = distance, abs(cross) / np.sqrt(ex * ex + ey * ey)
    return best, cosine


@compiled
def place_outline(pose: NDArray[np.float64], outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners `(k, 2)` of an outline at a pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    corners = np.empty_like(outline)
    for i in range(outline.shape[0]):
        corners[i, 0] = pose[0] + c * outline[i, 0] - s * outline[i, 1]
        corners[i, 1] = pose[1] + s * outline[i, 0] + c * outline[i, 1]
    return corners


@compiled
def outline_gains(
    poses: NDArray[np.float64],
    outline: NDArray[np.float64],
    beams: NDArray[np.float64],
    ranges: NDArray[np.float64],
    background: NDArray[np.float64],
    sigma: float,
    random_share: float,
    random_density: float,
) -> NDArray[np.float64]:
    """log P(L | object at pose) - log P(L | no object) `(n,)`, summed over the beams that meet the outline.

    `beams` `(m, 4)` are origins and unit directions, `background` `(m,)` the distance (m) of each end point from the surface
    that explains it otherwise (a wall, another object; infinite without one). What a beam meets before the outline hides it.
    """
    n, m = poses.shape[0], beams.shape[0]
    peak = (1.0 - random_share) / (_ROOT_TWO_PI * sigma)
    floor = random_share * random_density
    otherwise = np.empty(m)
    for b in range(m):
        if background[b] < 5.0 * sigma:
            otherwise[b] = np.log(peak * np.exp(-0.5 * (background[b] / sigma) ** 2) + floor)
        else:
            otherwise[b] = np.log(random_density)
        otherwise[b] = max(otherwise[b], np.log(random_density))
    radius = 0.0
    mx, my = (
        0.5 * (outline[:, 0].min() + outline[:, 0].max()),
        0.5 * (outline[:, 1].min() + outline[:, 1].max()),
    )
    for i in range(outline.shape[0]):
        radius = max(radius, np.hypot(outline[i, 0] - mx, outline[i, 1] - my))
    gains = np.zeros(n)
    for p in range(n):
        corners = place_outline(poses[p], outline)
        c, s = np.cos(poses[p, 2]), np.sin(poses[p, 2])
        cx, cy = poses[p, 0] + c * mx - s * my, poses[p, 1] + s * mx + c * my
        total = 0.0
        for b in range(m):
            dx, dy = beams[b, 2], beams[b, 3]
            wx, wy = cx - beams[b, 0], cy - beams[b, 1]
            if abs(dx * wy - dy * wx) > radius or dx * wx + dy * wy < -radius:
                continue
            distance, cosine = trace_outline(corners, beams[b, 0], beams[b, 1], dx, dy)
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
    """Distance (m) of each end point from the face of the polygon `(k, 2)` that its beam meets first `(m,)`.

    Negative: the beam ends before it; infinite: it passes by.
    """
    out = np.full(beams.shape[0], np.inf)
    for b in range(beams.shape[0]):
        distance, cosine = trace_outline(corners, beams[b, 0], beams[b, 1], beams[b, 2], beams[b, 3])
        if distance < np.inf:
            out[b] = (ranges[b] - distance) * cosine
    return out


@compiled
def tag_log_likelihood(
    tags: NDArray[np.float64],
    antennas: NDArray[np.float64],
    is_read: NDArray[np.bool_],
    scan_of_round: NDArray[np.int64],
    viewpoints: NDArray[np.float64],
    profiles: NDArray[np.float64],
    slack_m: float,
    model: NDArray[np.float64],
) -> NDArray[np.float64]:
    """log P(I | tag at pose) `(n,)` of inventory rounds from antennas `(r, 3)`; silent rounds count as well.

    `profiles` `(s, bins)` are the ranges that scans measured around `viewpoints` `(s, 3)`: a tag that lies farther behind
    what was seen there than `slack_m` is hidden. `model` is that of `sensors.rfid.AntennaModel.parameters`.
    """
    reach, softness, p_most, p_stray, hidden_share, least_facing = model
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
            distance = max(np.sqrt(wx * wx + wy * wy), 1e-3)
            off = 0.5 * (1.0 + (wx * ahead_x[r] + wy * ahead_y[r]) / distance)
            facing = max(0.5 * (1.0 - (wx * normal_x + wy * normal_y) / distance), least_facing)
            limit = reach * off * facing
            chance = p_most / (1.0 + np.exp((distance - limit) / (softness * reach)))
            if hidden[scan_of_round[r]]:
                chance *= hidden_share
            chance = min(p_stray + (1.0 - p_stray) * chance, 0.99)
            total += np.log(chance if is_read[r] else 1.0 - chance)
        out[p] = total
    return out


@compiled
def mark_points_on(
    points: NDArray[np.float64], corners: NDArray[np.float64], reach: float, marked: NDArray[np.bool_]
) -> None:
    """Mark the points `(m, 2)` that lie within a polygon `(k, 2)` or no farther than `reach` from its edges."""
    k = corners.shape[0]
    low_x, high_x = corners[:, 0].min() - reach, corners[:, 0].max() + reach
    low_y, high_y = corners[:, 1].min() - reach, corners[:, 1].max() + reach
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
            share = min(max(((x - ax) * ex + (y - ay) * ey) / square, 0.0), 1.0)
            if np.hypot(x - ax - share * ex, y - ay - share * ey) <= reach:
                marked[p] = True
                break
            if (ay > y) != (ay + ey > y) and x < ax + (y - ay) * ex / ey:
                inside = not inside
        if inside:
            marked[p] = True
