"""Two maps of one place: how one lies on the other, how well their walls agree, and a picture of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import InputError
from gridslam.evaluation.map_errors import intersection_over_union, wall_distances
from gridslam.evaluation.map_overlap import MapOverlap, register_overlapping
from gridslam.evaluation.map_registration import MapRegistration, register_maps
from gridslam.maps.editing import FREE_UP_TO, OCCUPIED_FROM, resampled
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]

# Smallest ratio of the wall points of the smaller map that agree: the maps overlap in part
MIN_MERGED_RATIO = 0.3
BOTH, FIRST_ONLY, SECOND_ONLY = (28, 32, 40), (205, 45, 45), (30, 110, 200)
FREE, UNKNOWN = (255, 255, 255), (214, 218, 224)


@dataclass(frozen=True, slots=True)
class MapComparison:
    """Distances (m) between walls both ways, intersection over union of the wall cells, and a picture of both maps."""

    accuracy_m: Floats
    completeness_m: Floats
    iou: float
    picture: Image.Image


def align_maps(other: OccupancyGrid, base: OccupancyGrid) -> MapRegistration:
    """`T_base_other` by registration of the walls. Raises InputError: it is not found, or two poses fit about as well."""
    found = register_maps(other, base)
    hint = "give it with --pose X,Y,YAW"
    if found is None or found.inlier_ratio < MIN_MERGED_RATIO:
        ratio = 0.0 if found is None else found.inlier_ratio
        raise InputError(
            f"the maps do not lie on each other ({100 * ratio:.0f} % of the walls agree): {hint}"
        )
    if found.is_ambiguous:
        raise InputError(f"two poses of the maps fit about as well: {hint}")
    return found


def overlap_of(other: OccupancyGrid, base: OccupancyGrid) -> MapOverlap:
    """The pose of a map in another one that it overlaps in part. Raises InputError: it is not certain."""
    found = register_overlapping(other, base)
    if found is None:
        raise InputError("a map has no walls: give the pose of the second one with --pose X,Y,YAW")
    if not found.is_reliable:
        x, y, yaw = found.T_base_other.tolist()
        raise InputError(
            f"how the maps lie on each other is not certain: of the walls of one {100 * found.contradicted_ratio:.1f} % lie in "
            f"free space of the other in the best pose, {x:.3f},{y:.3f},{yaw:.4f}, and its score is {found.lead:.2f} times that "
            "of the next one; if it is right, give it with --pose"
        )
    return found


def compare_maps(base: OccupancyGrid, other: OccupancyGrid, T_base_other: Floats) -> MapComparison:
    """The second map compared with the first one as `evaluate` compares a map with the truth. Raises MapError: too many walls."""
    distances = wall_distances(other, base, T_base_other)
    iou = intersection_over_union(other, base, T_base_other)
    return MapComparison(distances.accuracy, distances.completeness, iou, _picture(base, other, T_base_other))


def _picture(base: OccupancyGrid, other: OccupancyGrid, T_base_other: Floats) -> Image.Image:
    """Walls of both black, of the first alone red, of the second alone blue, on the cells of the first map."""
    from scipy.ndimage import binary_dilation

    one = base.probability
    two = resampled(other, T_base_other, base.geometry, (one.shape[0], one.shape[1]))
    first, second = one > OCCUPIED_FROM, two > OCCUPIED_FROM
    near_first, near_second = (binary_dilation(wall, iterations=2) for wall in (first, second))
    colours = np.empty((*one.shape, 3), np.uint8)
    colours[:] = UNKNOWN
    colours[(one <= FREE_UP_TO) | (two <= FREE_UP_TO)] = FREE
    colours[first & ~near_second] = FIRST_ONLY
    colours[second & ~near_first] = SECOND_ONLY
    colours[(first & near_second) | (second & near_first)] = BOTH
    return Image.fromarray(colours[::-1].copy())
