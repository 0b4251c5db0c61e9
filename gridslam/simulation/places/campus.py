"""Outdoor campuses: paths around buildings in loops of about 300 m, with rows of trees and building fronts."""

from __future__ import annotations

import math

import numpy as np

from gridslam.simulation.places.layout import XY, Array, Lane, Layout
from gridslam.simulation.places.walls import Bay, bayed_polygon, inset

LATERAL_M = 1.0
CLEAR_M = 2.6  # nothing stands nearer to the centre line of a path
FRONT_DEPTH_M = 14.0


def campus(rng: np.random.Generator) -> Layout:
    """Two or three blocks a row, one to three rows; a block is a building with bays, or a park."""
    cols, rows = int(rng.integers(2, 4)), int(rng.integers(1, 4))
    x = np.concatenate([[0.0], np.cumsum(rng.uniform(72.0, 95.0, cols))])
    y = np.concatenate([[0.0], np.cumsum(rng.uniform(58.0, 76.0, rows))])
    grid = np.stack(np.meshgrid(x, y), axis=-1) + rng.uniform(-5.0, 5.0, (rows + 1, cols + 1, 2))
    layout = Layout()
    nodes = np.array([[layout.add_node((float(p[0]), float(p[1]))) for p in row] for row in grid])
    for line in [*nodes, *nodes.T]:
        layout.add_lanes((int(node) for node in line), LATERAL_M)
    for i in range(rows):
        for j in range(cols):
            block = np.array([grid[i, j], grid[i, j + 1], grid[i + 1, j + 1], grid[i + 1, j]])
            if rng.random() < 0.8:
                _add_building(layout, inset(block, float(rng.uniform(5.5, 12.0))), rng)
            else:
                _scatter_trees(layout, inset(block, 4.0), 60.0, rng)
    _add_surroundings(layout, grid, rng)
    _add_rows_along_paths(layout, rng)
    for _ in range(int(rng.integers(2, 6))):
        lane = layout.lanes[int(rng.integers(len(layout.lanes)))]
        layout.people.append(_beside(layout, lane, 1.9))
    return layout


def _beside(layout: Layout, lane: Lane, offset_m: float) -> tuple[XY, XY]:
    """A path to the left of a lane that ends before its nodes."""
    start, end = np.array(layout.nodes[lane.first]), np.array(layout.nodes[lane.second])
    span = (end - start) / np.hypot(*(end - start))
    offset = offset_m * np.array([-span[1], span[0]])
    (x0, y0), (x1, y1) = (start + 6.0 * span + offset).tolist(), (end - 6.0 * span + offset).tolist()
    return (x0, y0), (x1, y1)


def _add_building(layout: Layout, contour: Array, rng: np.random.Generator) -> None:
    """Fronts with windows recessed in bays that are all alike, and one entrance that is not."""
    bay = Bay(float(rng.uniform(3.0, 6.0)), float(rng.uniform(1.2, 2.2)), float(rng.uniform(0.15, 0.5)))
    layout.add_wall(bayed_polygon(contour, bay), closed=True, reflectivity=float(rng.choice([0.7, 0.5, 0.2])))
    side = int(rng.integers(len(contour)))
    start, end = contour[side], contour[(side + 1) % len(contour)]
    span = (end - start) / np.hypot(*(end - start))
    outwards = np.array([span[1], -span[0]])
    x, y = (start + float(rng.uniform(0.2, 0.8)) * (end - start) + 0.9 * outwards).tolist()
    layout.add_box((x, y), (float(rng.uniform(3.0, 6.0)), 1.7), math.atan2(span[1], span[0]))


def _scatter_trees(layout: Layout, area: Array, m2_per_tree: float, rng: np.random.Generator) -> None:
    """Add trees at random places of the box around `area` `(n, 2)` (m), clear of all paths."""
    low, high = area.min(axis=0), area.max(axis=0)
    for _ in range(int(np.prod(high - low) / m2_per_tree)):
        x, y = rng.uniform(low, high).tolist()
        _add_tree(layout, (x, y), rng)


def _add_tree(layout: Layout, centre: XY, rng: np.random.Generator) -> None:
    radius = float(rng.uniform(0.12, 0.35))
    if layout.distance_to_lanes(centre) > CLEAR_M + radius:
        layout.add_trunk(centre, radius)


def _add_surroundings(layout: Layout, grid: Array, rng: np.random.Generator) -> None:
    """Add the surroundings of the outermost paths: fronts of other buildings, or trees on open ground."""
    ring = [*grid[0], *grid[1:, -1], *grid[-1, -2::-1], *grid[-2:0:-1, 0]]
    for start, end in zip(ring, [*ring[1:], ring[0]], strict=True):
        span = (end - start) / np.hypot(*(end - start))
        outwards = np.array([span[1], -span[0]])
        gap = float(rng.uniform(6.0, 14.0))
        corners = [start + 6.0 * span, end - 6.0 * span]
        near, far = gap * outwards, (gap + FRONT_DEPTH_M) * outwards
        contour = np.array([corners[0] + far, corners[1] + far, corners[1] + near, corners[0] + near])
        if rng.random() < 0.6:
            _add_building(layout, contour, rng)
        else:
            _scatter_trees(layout, contour, 45.0, rng)


def _add_rows_along_paths(layout: Layout, rng: np.random.Generator) -> None:
    """Beside each path a row of trees or of parked cars, a row on either side, or nothing."""
    for lane in list(layout.lanes):
        start, end = np.array(layout.nodes[lane.first]), np.array(layout.nodes[lane.second])
        length = float(np.hypot(*(end - start)))
        span = (end - start) / length
        left = np.array([-span[1], span[0]])
        yaw = math.atan2(span[1], span[0])
        kind = rng.random()
        if kind < 0.3:
            side, pitch = float(rng.choice([-1.0, 1.0])), float(rng.uniform(5.4, 6.2))
            for along in np.arange(9.0, length - 9.0, pitch):
                if rng.random() < 0.7:
                    x, y = (start + along * span + side * 3.6 * left).tolist()
                    layout.add_box((x, y), (4.3, 1.8), yaw, 0.5)
        elif kind < 0.8:
            sides = (-1.0, 1.0) if kind < 0.5 else (float(rng.choice([-1.0, 1.0])),)
            pitch = float(rng.uniform(6.0, 10.0))
            for along in np.arange(5.0, length - 5.0, pitch):
                for side in sides:
                    x, y = (start + (along + rng.uniform(-0.3, 0.3)) * span + side * 3.2 * left).tolist()
                    _add_tree(layout, (x, y), rng)
