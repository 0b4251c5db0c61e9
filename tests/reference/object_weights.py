"""Reference implementations of `gridslam.kernels.object_weights`: one beam, one round, one point at a time."""

from __future__ import annotations

import math

import numpy as np
from shapely.geometry import LineString, Point, Polygon

from gridslam.core import poses as se2
from gridslam.sensors.rfid import AntennaModel

FAR_M = 100.0


def face_met(corners: np.ndarray, beam: np.ndarray) -> tuple[float, float] | None:
    """Distance to the polygon's nearest edge along a beam and the cosine of incidence; None when it passes by."""
    origin, direction = beam[:2], beam[2:]
    ray = LineString([origin, origin + FAR_M * direction])
    met = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        cut = ray.intersection(LineString([a, b]))
        if not cut.is_empty:
            normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
            met.append((Point(origin).distance(cut), abs(float(normal @ direction))))
    return min(met) if met else None


def outline_gain(
    pose: np.ndarray,
    outline: np.ndarray,
    beams: np.ndarray,
    ranges: np.ndarray,
    background: np.ndarray,
    sigma: float,
    share: float,
    density: float,
) -> float:
    """log P(L | object at pose) - log P(L | no object), by the mixture of each beam."""
    total = 0.0
    corners = se2.transform_points(pose, outline)

    def mixture(error: float) -> float:
        normal = math.exp(-0.5 * (error / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
        return (1.0 - share) * normal + share * density

    for beam, reading, other in zip(beams, ranges, background, strict=True):
        met = face_met(corners, beam)
        if met is None:
            continue
        otherwise = max(mixture(other), density) if math.isfinite(other) else density
        error = (reading - met[0]) * met[1]
        explained = mixture(error)
        if error < 0.0:
            explained = max(explained, otherwise)
        total += math.log(explained) - math.log(otherwise)
    return total


def read_probability(tag: np.ndarray, antenna: np.ndarray, is_hidden: bool, model: AntennaModel) -> float:
    """P(a round reads the tag)."""
    way = tag[:2] - antenna[:2]
    distance, direction = float(np.hypot(*way)), math.atan2(way[1], way[0])
    bearing = 0.5 * (1.0 + math.cos(direction - antenna[2]))
    facing = max(0.5 * (1.0 + math.cos(direction + math.pi - tag[2])), model.least_facing)
    limit = model.reach_m * bearing * facing
    chance = model.p_most / (1.0 + math.exp((distance - limit) / (model.softness * model.reach_m)))
    chance *= model.hidden_share if is_hidden else 1.0
    return model.p_stray + (1.0 - model.p_stray) * chance


def is_on(point: np.ndarray, corners: np.ndarray, reach_m: float) -> bool:
    """Whether a point lies in a polygon or within reach of it."""
    return Polygon(corners).distance(Point(point)) <= reach_m
