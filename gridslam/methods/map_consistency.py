"""What a run says of its map's consistency: measures, the map with its doubtful places drawn on it, and the status."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.map_consistency.assessment import DoubtfulPlace, MapConsistency
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import Footprint, render_map
from gridslam.methods.base import Doubt, Picture, RunResult

DOUBTFUL_INK, SUSPECT_INK = (205, 45, 45), (235, 130, 20)
SMALLEST_RADIUS_M = 1.0
CORNERS = 32


def with_consistency(result: RunResult, consistency: MapConsistency) -> RunResult:
    """The result with its map's consistency; a doubtful map makes the run `inconsistent`."""
    assert result.occupancy is not None
    pictures = _pictures(result.occupancy, result.trajectory, consistency)
    doubt = Doubt("inconsistent", consistency.summary) if consistency.is_doubtful else result.doubt
    return replace(
        result,
        measures={**result.measures, "map_consistency": consistency.measures},
        pictures={**result.pictures, **pictures},
        doubt=doubt,
    )


def _pictures(grid: OccupancyGrid, trajectory: Trajectory, consistency: MapConsistency) -> dict[str, Picture]:
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
