"""Localization in a drawing while driving, by hypotheses for all places so far."""

from __future__ import annotations

import cv2
import numpy as np

from gridslam.maps.drawings.drawing import Drawing, drawn_map
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_tracker import localizer_of
from gridslam.methods.handmap_slam.place_localizer import PlaceLocalizer
from gridslam.sensors.range_caster import range_caster

CELL_M = 0.05
NICHES_M = (6.0, 9.0, 11.0, 16.0, 20.0, 22.0, 26.0)  # along a corridor of 30 x 2 m, to either side in turn
MIDDLE_M, LENGTH_M = 15.0, 30.0
SECOND_SCALE = 1.3  # of what lies beyond the middle, in a drawing that is at scale 1 before it


def corridor(cell: float, second_scale: float) -> np.ndarray:
    """Walls `(rows, cols)` of the corridor with a margin of 3 m."""
    image = np.zeros((round(8.0 / cell), round((LENGTH_M * second_scale + 8.0) / cell)), np.uint8)

    def pixel(x: float, y: float) -> tuple[int, int]:
        return round((3.0 + drawn_x(x, second_scale)) / cell), round((3.0 + y) / cell)

    contour = [(0.0, 0.0)]
    sides: tuple[list[tuple[float, float]], list[tuple[float, float]]] = ([], [])
    for number, x in enumerate(NICHES_M):
        side = number % 2
        y, depth = (0.0, -1.2) if side == 0 else (2.0, 3.2)
        sides[side].extend([(x, y), (x, depth), (x + 1.0, depth), (x + 1.0, y)])
    contour += [*sides[0], (LENGTH_M, 0.0), (LENGTH_M, 2.0), *reversed(sides[1]), (0.0, 2.0)]
    cv2.polylines(image, [np.array([pixel(*p) for p in contour])], True, 1, 1)
    return image > 0


def drawn_x(x: float, second_scale: float) -> float:
    return min(x, MIDDLE_M) + second_scale * max(x - MIDDLE_M, 0.0)


def test_the_robot_is_localized_in_a_wing_that_is_drawn_at_another_scale_and_where_it_was_when_it_returns() -> (
    None
):
    world = corridor(CELL_M, 1.0)
    caster = range_caster(world, GridGeometry(CELL_M, (-3.0, -3.0)))
    levels = np.where(corridor(0.1, SECOND_SCALE), 0, 255).astype(np.uint8)
    start = (4.0, 4.0, 0.0)
    drawn = drawn_map(Drawing(levels, "corridor"), start_xy=start[:2])
    config = HandmapSlamConfig(start=start)
    localizer = localizer_of(config, drawn, np.random.default_rng(0))
    assert isinstance(localizer, PlaceLocalizer)
    bearings = np.linspace(-np.pi, np.pi, 120, endpoint=False)
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
    errors = []
    path = np.concatenate([np.arange(1.0, 28.0, 0.5), np.arange(27.5, 0.9, -0.5)])
    for before, x in zip([path[0], *path[:-1]], path, strict=True):
        ranges = caster.ranges(np.array([[x, 1.0, 0.0]]), bearings, np.zeros(3), 20.0)[0].astype(np.float64)
        points = (ranges[:, None] * directions)[ranges < 19.9]
        if not errors:
            belief = localizer.start(points)
        else:
            localizer.predict(np.array([x - before, 0.0, 0.0]))
            belief = localizer.update(points)
        errors.append(float(np.hypot(*(belief.state[:2] - (3.0 + drawn_x(x, SECOND_SCALE), 4.0)))))
    assert max(errors) < 1.5
    assert np.median(errors) < 0.6
    assert errors[-1] < 0.6
