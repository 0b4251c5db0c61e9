"""Report of a map's consistency: measures, the map with its doubtful places drawn on it, and the status of the run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.map_consistency.assessment import DOUBTFUL, MapConsistency
from gridslam.lidar_slam.map_consistency.doubtful_places import DoubtfulPlace
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import Footprint, render_map
from gridslam.methods.base import Doubt, Picture, RunResult

DOUBTFUL_INK, SUSPECT_INK = (205, 45, 45), (235, 130, 20)
SMALLEST_RADIUS_M = 1.0
CORNERS = 32
# Fraction of the path with a second passage from which doubts about the motion are dropped
MIN_REVISITED = 0.5
LABELS_APART_M = 8.0  # places nearer than this to a more doubtful one get a circle without a number


def with_consistency(
    result: RunResult,
    consistency: MapConsistency,
    motion_doubt: str | None = None,
    sensor_doubt: str | None = None,
) -> RunResult:
    """The result with the consistency of its map.

    The run becomes `inconsistent` if the map is doubtful, if sensors contradict each other (`sensor_doubt`, in words), or if the
    motion is doubtful (`motion_doubt`) and the robot drove most of the path only once.
    """
    assert result.occupancy is not None
    pictures = _pictures(result.occupancy, result.trajectory, consistency)
    doubt = result.doubt
    if consistency.is_doubtful:
        doubt = Doubt("inconsistent", consistency.summary)
    elif sensor_doubt is not None and doubt is None:
        doubt = Doubt("inconsistent", sensor_doubt)
    elif motion_doubt is not None and doubt is None and consistency.revisited < MIN_REVISITED:
        doubt = Doubt("inconsistent", motion_doubt)
    return replace(
        result,
        measures={**result.measures, "map_consistency": consistency.measures},
        pictures={**result.pictures, **pictures},
        doubt=doubt,
    )


def _pictures(grid: OccupancyGrid, trajectory: Trajectory, consistency: MapConsistency) -> dict[str, Picture]:
    """The picture `doubt`: the map and the trajectory with circles around the doubtful places; empty if there are none."""
    if not consistency.places:
        return {}
    circles = [_circle(place, consistency.places[:k]) for k, place in enumerate(consistency.places)]
    rgb = np.asarray(render_map(grid, trajectory, footprints=circles), np.uint8)
    note = (
        "Circles: where the map contradicts itself, with the doubt of each place. "
        + consistency.summary
        + "."
    )
    return {"doubt": Picture(rgb, "Doubtful places", note)}


def _circle(place: DoubtfulPlace, more_doubtful: Sequence[DoubtfulPlace]) -> Footprint:
    radius = max(0.5 * place.size_m, SMALLEST_RADIUS_M)
    angle = np.arange(CORNERS) * (math.tau / CORNERS)
    corners = np.array([place.x_m, place.y_m]) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    distances_m = [math.hypot(place.x_m - other.x_m, place.y_m - other.y_m) for other in more_doubtful]
    is_apart = min(distances_m, default=math.inf) > LABELS_APART_M
    ink = DOUBTFUL_INK if place.doubt > DOUBTFUL else SUSPECT_INK
    return corners, ink, f"{place.doubt:.2f}" if is_apart else ""
