"""Office floors: corridors around blocks of rooms, loops within loops, rooms to look into."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from gridslam.simulation.places.corridors import CABINET_M
from gridslam.simulation.places.layout import XY, Array, Layout
from gridslam.simulation.places.walls import Bay, bayed_wall

DOOR_M = 1.0
SHUT_DEPTH_M = 0.12
OUTER_DEPTH_M = 5.5
VISITED = 0.12  # fraction of the open rooms that the robot drives into


@dataclass(frozen=True, slots=True)
class _Row:
    """Rooms side by side from `x0` to `x1`: fronts on a corridor at `front_y`, back wall at `back_y`."""

    x0: float
    x1: float
    front_y: float
    back_y: float
    corridor_y: float


def office(rng: np.random.Generator) -> Layout:
    """Three to five blocks a row, two or three rows, and rooms along the outer walls."""
    width = float(rng.uniform(2.0, 2.8))
    x = np.concatenate([[0.0], np.cumsum(rng.uniform(16.0, 32.0, int(rng.integers(3, 6))))])
    y = np.concatenate([[0.0], np.cumsum(rng.uniform(14.0, 20.0, int(rng.integers(2, 4))))])
    room_width = float(rng.uniform(3.0, 4.5)) if rng.random() < 0.5 else None  # all alike, or each its own
    layout = Layout()
    doors: list[tuple[XY, XY]] = []
    for x0, x1 in zip(x + 0.5 * width, x[1:] - 0.5 * width, strict=False):
        for south, north in itertools.pairwise(y):
            doors += _block(
                layout,
                (float(x0), float(x1)),
                corridor_ys=(float(south), float(north)),
                width=width,
                room_width=room_width,
                rng=rng,
            )
    for corridor_y, outwards in ((float(y[0]), -1.0), (float(y[-1]), 1.0)):
        front = corridor_y + outwards * 0.5 * width
        row = _Row(
            float(x[0] - 0.5 * width),
            float(x[-1] + 0.5 * width),
            front,
            front + outwards * OUTER_DEPTH_M,
            corridor_y,
        )
        doors += _rooms(layout, row, room_width, rng)
        layout.add_wall([(row.x0, row.back_y), (row.x1, row.back_y)])
    south, north = float(y[0] - 0.5 * width - OUTER_DEPTH_M), float(y[-1] + 0.5 * width + OUTER_DEPTH_M)
    bay = Bay(float(rng.uniform(2.5, 5.0)), 1.2, 0.2)
    west, east = float(x[0] - 0.5 * width), float(x[-1] + 0.5 * width)
    layout.add_wall(bayed_wall((west, south), (west, north), bay))
    layout.add_wall(bayed_wall((east, north), (east, south), bay))
    _add_lanes(layout, x, y=y, doors=doors, lateral_m=0.5 * width - CABINET_M - 0.4, rng=rng)
    for _ in range(int(rng.integers(2, 6))):
        row_y = float(rng.choice(y)) + (0.5 * width - 0.35) * float(rng.choice([-1.0, 1.0]))
        layout.people.append(((float(x[0]) + 4.0, row_y), (float(x[-1]) - 4.0, row_y)))
    return layout


def _block(
    layout: Layout, xs: XY, corridor_ys: XY, width: float, room_width: float | None, rng: np.random.Generator
) -> list[tuple[XY, XY]]:
    """Two rows of rooms back to back between two corridors; the doors that the robot can use."""
    x0, x1 = xs
    south, north = corridor_ys[0] + 0.5 * width, corridor_ys[1] - 0.5 * width
    middle = south + (north - south) * float(rng.uniform(0.42, 0.58))
    bay = Bay(float(rng.uniform(2.5, 4.0)), 1.0, 0.15)
    layout.add_wall(bayed_wall((x0, north), (x0, south), bay))
    layout.add_wall(bayed_wall((x1, south), (x1, north), bay))
    layout.add_wall([(x0, middle), (x1, middle)])
    rows = (_Row(x0, x1, south, middle, corridor_ys[0]), _Row(x0, x1, north, middle, corridor_ys[1]))
    return [door for row in rows for door in _rooms(layout, row, room_width, rng)]


def _rooms(
    layout: Layout, row: _Row, room_width: float | None, rng: np.random.Generator
) -> list[tuple[XY, XY]]:
    """Fronts with doors, partitions and furniture of a row; for each open room a point in the corridor and one inside."""
    inwards = 1.0 if row.back_y > row.front_y else -1.0
    length = row.x1 - row.x0
    count = max(round(length / (room_width or 4.0)), 1)
    widths = np.ones(count) if room_width else rng.uniform(0.75, 1.6, count)
    borders = row.x0 + np.concatenate([[0.0], np.cumsum(widths * length / widths.sum())])
    doors = []
    at: list[XY] = [(row.x0, row.front_y)]
    for west, east in zip(borders.tolist(), borders[1:].tolist(), strict=False):
        door = (
            west + 0.5 * (east - west - DOOR_M) if room_width else float(rng.uniform(west + 0.4, east - 1.5))
        )
        door = round(door, 3)
        is_open = rng.random() < 0.45
        at.append((door, row.front_y))
        if is_open:
            layout.add_wall(at, reflectivity=float(rng.choice([0.7, 0.7, 0.7, 0.15])))
            at = [(door + DOOR_M, row.front_y)]
            inside = row.front_y + inwards * 1.5
            doors.append(((door + 0.5 * DOOR_M, row.corridor_y), (door + 0.5 * DOOR_M, inside)))
            _furnish(layout, (west, east), row, inwards, rng)
        else:
            shut = row.front_y + inwards * SHUT_DEPTH_M
            at += [(door, shut), (door + DOOR_M, shut), (door + DOOR_M, row.front_y)]
        if east < row.x1:
            layout.add_wall([(east, row.front_y), (east, row.back_y)])
    at.append((row.x1, row.front_y))
    layout.add_wall(at)
    return doors


def _furnish(layout: Layout, xs: XY, row: _Row, inwards: float, rng: np.random.Generator) -> None:
    """A desk and one or two other pieces at the back of a room, clear of where the robot turns."""
    west, east = xs
    back = row.back_y - inwards * 0.55
    for _ in range(int(rng.integers(1, 4))):
        size = float(rng.uniform(0.4, min(1.8, east - west - 0.4))), float(rng.uniform(0.4, 0.8))
        x = float(rng.uniform(west + 0.5 * size[0] + 0.1, east - 0.5 * size[0] - 0.1))
        layout.add_box((x, back - inwards * float(rng.uniform(0.0, 0.7))), size)


def _add_lanes(
    layout: Layout,
    x: Array,
    y: Array,
    doors: list[tuple[XY, XY]],
    lateral_m: float,
    rng: np.random.Generator,
) -> None:
    """Corridors as lanes, with a node at each door that the robot uses and a lane into the room behind it."""
    nodes = {(float(px), float(py)): layout.add_node((float(px), float(py))) for py in y for px in x}
    for outside, inside in doors:
        if rng.random() < VISITED:
            if outside not in nodes:  # there may be a door across the corridor
                nodes[outside] = layout.add_node(outside)
            layout.add_lanes((nodes[outside], layout.add_node(inside)), 0.0)
    for py in y.tolist():
        layout.add_lanes((node for (_, at), node in sorted(nodes.items()) if at == py), lateral_m)
    for px in x.tolist():
        layout.add_lanes((nodes[px, py] for py in y.tolist()), lateral_m)
