"""Corridors of 100 to 250 m, side by side and joined by cross corridors: every bay looks like the next."""

from __future__ import annotations

import itertools

import numpy as np

from gridslam.simulation.places.layout import Array, Layout
from gridslam.simulation.places.walls import Bay, bayed_polygon, inset

CABINET_M = 0.35  # depth of what stands in a corridor


def corridors(rng: np.random.Generator) -> Layout:
    """Two or three long corridors; only a cabinet or pillar every 25 to 60 m distinguishes one place from another."""
    bay = Bay(float(rng.uniform(2.4, 4.5)), float(rng.uniform(0.9, 1.2)), float(rng.uniform(0.12, 0.3)))
    width = float(rng.uniform(2.2, 3.0))
    length = float(rng.uniform(100.0, 250.0))
    blocks = int(rng.integers(3, 6))
    x = np.concatenate([[0.0], np.cumsum(rng.uniform(0.6, 1.4, blocks))])
    x *= length / x[-1]
    y = np.concatenate([[0.0], np.cumsum(rng.uniform(14.0, 35.0, int(rng.choice([1, 1, 2]))))])
    layout = Layout()
    add_grid_lanes(layout, x, y, lateral_m=0.5 * width - CABINET_M - 0.45)
    for x0, x1 in itertools.pairwise(x):
        for y0, y1 in itertools.pairwise(y):
            block = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
            layout.add_wall(bayed_polygon(inset(block, 0.5 * width), bay), closed=True)
    add_outer_wall(layout, x, y, width, bay)
    _add_clutter(layout, x, y, width, rng)
    for _ in range(int(rng.integers(1, 4))):
        row = float(rng.choice(y)) + (0.5 * width - 0.4) * float(rng.choice([-1.0, 1.0]))
        layout.people.append(((4.0, row), (length - 4.0, row)))
    return layout


def add_grid_lanes(layout: Layout, x: Array, y: Array, lateral_m: float) -> None:
    """Nodes at all crossings of the corridors at `x` `(m,)` and `y` `(n,)`, with lanes between neighbours."""
    nodes = np.array([[layout.add_node((float(px), float(py))) for px in x] for py in y])
    for row in [*nodes, *nodes.T]:
        layout.add_lanes((int(node) for node in row), lateral_m)


def add_outer_wall(layout: Layout, x: Array, y: Array, width_m: float, bay: Bay) -> None:
    """Add the wall around corridors at `x` `(n,)` and `y` `(m,)` (m), with bays on the outer side."""
    corners = np.array([(x[0], y[0]), (x[-1], y[0]), (x[-1], y[-1]), (x[0], y[-1])])
    layout.add_wall(bayed_polygon(inset(corners, -0.5 * width_m)[::-1], bay), closed=True)


def _add_clutter(layout: Layout, x: Array, y: Array, width_m: float, rng: np.random.Generator) -> None:
    """Cabinets and pillars along the walls of the long corridors, away from crossings."""
    for row in y.tolist():
        at = float(rng.uniform(5.0, 40.0))
        while at < x[-1] - 4.0:
            if np.abs(x - at).min() > 0.5 * width_m + 1.5:
                side = float(rng.choice([-1.0, 1.0]))
                if rng.random() < 0.7:
                    size = float(rng.uniform(0.5, 1.8)), CABINET_M
                    layout.add_box((at, row + side * 0.5 * (width_m - CABINET_M)), size)
                else:
                    layout.add_trunk((at, row + side * (0.5 * width_m - 0.17)), 0.15, 0.7)
            at += float(rng.uniform(25.0, 60.0))
