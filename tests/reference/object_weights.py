"""Reference implementations of `gridslam.kernels.object_weights`: one beam, one round, one point at a time."""

from __future__ import annotations

import math

import numpy as np
from shapely.geometry import LineString, Point, Polygon

from gridslam.core import poses as se2
from gridslam.kernels.object_weights import EndpointMixture, ObservedBeams
from gridslam.sensors.rfid import AntennaModel

FAR_M = 100.0


def face_met(corners: np.ndarray, beam: np.ndarray) -> tuple[float, float] | None:
    """Distance to the polygon's nearest edge along a beam and the cosine of incidence; None if it misses."""
    origin, direction = beam[:2], beam[2:]
    ray = LineString([origin, origin + FAR_M * direction])
    met = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        cut = ray.intersection(LineString([a, b]))
        if not cut.is_empty:
            normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
            met.append((Point(origin).distance(cut), abs(float(normal @ direction))))
    return min(met) if met else None


def footprint_gain(
    pose: np.ndarray,
    footprint: np.ndarray,
    observed: ObservedBeams,
    mixture: EndpointMixture,
) -> float:
    """log P(L | object at pose) - log P(L | no object), by the mixture of each beam."""
    sigma, random_ratio, density = mixture
    total = 0.0
    corners = se2.transform_points(pose, footprint)

    def density_at(error: float) -> float:
        normal = math.exp(-0.5 * (error / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
        return (1.0 - random_ratio) * normal + random_ratio * density

    for beam, reading, other in zip(*observed, strict=True):
        met = face_met(corners, beam)
        if met is None:
            continue
        otherwise = max(density_at(other), density) if math.isfinite(other) else density
        error = (reading - met[0]) * met[1]
        explained = density_at(error)
        if error < 0.0:
            explained = max(explained, otherwise)
        total += math.log(explained) - math.log(otherwise)
    return total


def read_probability(tag: np.ndarray, antenna: np.ndarray, is_hidden: bool, model: AntennaModel) -> float:
    """P(a round reads the tag)."""
    offset = tag[:2] - antenna[:2]
    distance, direction = float(np.hypot(*offset)), math.atan2(offset[1], offset[0])
    bearing = 0.5 * (1.0 + math.cos(direction - antenna[2]))
    facing = max(0.5 * (1.0 + math.cos(direction + math.pi - tag[2])), model.min_facing)
    limit = model.range_m * bearing * facing
    chance = model.detection_probability / (
        1.0 + math.exp((distance - limit) / (model.softness * model.range_m))
    )
    chance *= model.hidden_ratio if is_hidden else 1.0
    return model.false_read_probability + (1.0 - model.false_read_probability) * chance


def is_on(point: np.ndarray, corners: np.ndarray, margin_m: float) -> bool:
    """Whether a point lies in a polygon or within a margin of it."""
    return Polygon(corners).distance(Point(point)) <= margin_m
