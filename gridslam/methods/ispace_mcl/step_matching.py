"""The step between two scans that agrees with both of them and with the odometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.kernels.scan_matching.correlative_matching import (
    FieldPyramid,
    SearchWindow,
    correlate,
    field_pyramid,
)
from gridslam.sensors.pose_search import climb

Floats = NDArray[np.float64]

_CELL_M = 0.05  # cell of the matching field; the refinement (`_STEPS`) goes on within it
_LEVELS = 4  # levels of its pyramid, whose widest cell has 0.4 m
_HALF_WIDTH_M = 12.0  # half width of the matching field; points farther away are too sparse to match
_MARGIN_M = 2.0  # points so near to the field's border are not matched: they may leave it
_SPLAT_CELLS = 3
_SPLAT_STD_CELLS = 1.5
_YAW_STEP_RAD = 0.01
_MATCH_POINTS = 90
_MIN_MATCH_POINTS = 20
_MIN_SCORE = 60.0  # smallest score of a match, of at most 255
# How far the odometry is trusted against the match: a fixed part and parts that grow with travel and rotation ...
_ODOMETRY_M, _ODOMETRY_PER_M = 0.02, 0.1
_ODOMETRY_RAD, _ODOMETRY_RAD_PER_RAD, _ODOMETRY_RAD_PER_M = 0.02, 0.1, 0.05
# ... and the log-likelihood of a perfect match: of fewer than all points, whose errors are common
_MATCH_WEIGHT = 40.0
_STEPS = ((0.1, 0.03), (0.1, 0.02), (0.05, 0.02), (0.05, 0.01), (0.025, 0.01), (0.025, 0.005))  # m, rad
# Search window of a match: a fixed part and parts that grow with the odometry's travel and rotation.
_SEARCH_M, _SEARCH_PER_M = 0.15, 0.3
_SEARCH_RAD, _SEARCH_RAD_PER_RAD, _SEARCH_RAD_PER_M = 0.06, 0.3, 0.3


def matched_step(before: Floats, after: Floats, step: Floats) -> Floats:
    """T_before_after `(3,)` that aligns the points `(m, 2)` of two scans near an odometry step; the step itself if none does."""
    near = np.abs(after).max(axis=1, initial=0.0) < _HALF_WIDTH_M - _MARGIN_M
    moving = after[near]
    if len(moving) < _MIN_MATCH_POINTS:
        return step
    field, origin = _likelihood_image(before)
    travel_m, rotation_rad = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    window_m = _SEARCH_M + _SEARCH_PER_M * travel_m
    window_rad = _SEARCH_RAD + _SEARCH_RAD_PER_RAD * rotation_rad + _SEARCH_RAD_PER_M * travel_m
    yaw_steps = int(np.ceil(window_rad / _YAW_STEP_RAD))
    found, score = correlate(
        FieldPyramid(field_pyramid(field, _LEVELS), origin, _CELL_M),
        np.ascontiguousarray(moving[evenly_spaced(len(moving), _MATCH_POINTS)]),
        step,
        SearchWindow(window_m, _YAW_STEP_RAD, yaw_steps),
        _MIN_SCORE,
    )
    return step if score < 0.0 else _drawn_to_odometry(field, origin, moving, step, np.asarray(found))


def _drawn_to_odometry(
    field: NDArray[np.uint8], origin: Floats, points: Floats, step: Floats, found: Floats
) -> Floats:
    """The step `(3,)` that agrees best with the points `(m, 2)` on the other scan's image and with the odometry step.

    Along a corridor all steps match about as well, and the match alone prefers those that are too short.
    """
    travel_m, rotation_rad = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    std_m = _ODOMETRY_M + _ODOMETRY_PER_M * travel_m
    std_rad = _ODOMETRY_RAD + _ODOMETRY_RAD_PER_RAD * rotation_rad + _ODOMETRY_RAD_PER_M * travel_m
    std = np.array([std_m, std_m, std_rad])

    def score(steps: Floats) -> Floats:
        moved = np.stack([se2.transform_points(tried, points) for tried in steps])
        cols, rows = np.moveaxis(np.floor((moved - origin) / _CELL_M).astype(np.int64), 2, 0)
        match = field[rows.clip(0, len(field) - 1), cols.clip(0, len(field) - 1)].mean(axis=1) / 255.0
        return np.asarray(_MATCH_WEIGHT * match - 0.5 * np.sum(((steps - step) / std) ** 2, axis=1))

    steps = np.stack([found, step])
    scores = score(steps)
    for step_m, step_rad in _STEPS:
        steps, scores = climb(score, steps, scores, step_m, step_rad)
    return np.asarray(steps[scores.argmax()])


def _likelihood_image(points: Floats) -> tuple[NDArray[np.uint8], Floats]:
    """An image with a Gaussian splat at every point, with the margin that its pyramid needs, and its lower-left corner (m)."""
    half = int(_HALF_WIDTH_M / _CELL_M) + (1 << _LEVELS) + _SPLAT_CELLS
    image = np.zeros((2 * half, 2 * half), np.uint8)
    cells = np.floor(points / _CELL_M).astype(np.int64) + half
    inside = ((cells >= _SPLAT_CELLS) & (cells < 2 * half - _SPLAT_CELLS)).all(axis=1)
    cells = cells[inside]
    for dr in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
        for dc in range(-_SPLAT_CELLS, _SPLAT_CELLS + 1):
            value = np.uint8(round(255.0 * np.exp(-0.5 * (dr * dr + dc * dc) / _SPLAT_STD_CELLS**2)))
            rows, cols = cells[:, 1] + dr, cells[:, 0] + dc
            image[rows, cols] = np.maximum(image[rows, cols], value)
    return image, np.array([-half * _CELL_M, -half * _CELL_M])
