"""The map with its doubtful places drawn on it."""

from __future__ import annotations

import math

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.map_consistency.assessment import DoubtfulPlace, MapConsistency
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import Footprint, render_map
from gridslam.methods.base import Picture

DOUBTFUL_INK, SUSPECT_INK = (205, 45, 45), (235, 130, 20)
SMALLEST_RADIUS_M = 1.0
CORNERS = 32


def consistency_pictures(
    grid: OccupancyGrid, trajectory: Trajectory, consistency: MapConsistency
) -> dict[str, Picture]:
    """`doubt`: the map and its trajectory with circles around the doubtful places; none where there are no such places."""
    if not consistency.places:
        return {}
    circles = [_circle(place) for place in consistency.places]
    rgb = np.asarray(render_map(grid, trajectory, footprints=circles), np.uint8)
    note = (
        "Circles: where the map contradicts itself, with the doubt of each place. "
        + consistency.summary
        + "."
    )
    return {"doubt": Picture(rgb, "Doubtful places", note)}


def _circle(place: DoubtfulPlace) -> Footprint:
    radius = max(0.5 * place.size_m, SMALLEST_RADIUS_M)
    angle = np.arange(CORNERS) * (math.tau / CORNERS)
    corners = np.array([place.x_m, place.y_m]) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return corners, DOUBTFUL_INK if place.doubt > 0.5 else SUSPECT_INK, f"{place.doubt:.2f}"
