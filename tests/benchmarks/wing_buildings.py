"""Buildings by seed: a chain of wings (rooms along a corridor or around a block, or a hall), joined by corridors.

Every part has a frame of its own, in which its walls are straight: u along its corridor, v to the left, metres. A building says
where each part lies in the world; a drawing of it says where each part lies on the paper (`people_drawings`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

STEP_M = 0.25  # spacing of points along walls, routes and centre lines
DOOR_M = 1.0
SHUT, UNVISITED = 0.15, 0.2  # fractions of the rooms
MAX_WINGS = 3
BLOCK = 0.4  # fraction of the wings whose rooms lie around a block
GAP_M = 1.5  # smallest distance between parts that are not neighbours


@dataclass(frozen=True)
class WingRoom:
    """A room of a wing from u0 to u1 and from its front (with the door) to its back; the robot may enter it or not."""

    u0: float
    u1: float
    front: float
    back: float
    door_u: float
    is_shut: bool
    is_visited: bool

    @property
    def contour(self) -> Floats:
        """Its corners `(5, 2)`, closed."""
        u0, u1, front, back = self.u0, self.u1, self.front, self.back
        return np.array([[u0, front], [u1, front], [u1, back], [u0, back], [u0, front]])


@dataclass
class Part:
    """A wing or a corridor between two wings: length along u, half widths along v, rooms in rows, and all other walls.

    `heading` `(n,)` is the direction of the centre line at `at` `(n,)`, relative to its start: all 0 for wings.
    """

    length: float
    extent: tuple[float, float]
    rows: list[list[WingRoom]] = field(default_factory=list)
    walls: list[Floats] = field(default_factory=list)
    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)  # u, v, size along u and v
    is_wing: bool = True
    heading: Floats = field(default_factory=lambda: np.zeros(2))
    routes: tuple[Floats, Floats] = (np.zeros((0, 2)), np.zeros((0, 2)))  # out and back

    @property
    def at(self) -> Floats:
        return np.linspace(0.0, self.length, len(self.heading))


@dataclass(frozen=True)
class CentreLine:
    """A line of points `(n, 2)` with headings `(n,)`, at distances `at` `(n,)` along u; v is measured across it."""

    at: Floats
    points: Floats
    headings: Floats

    @staticmethod
    def of(start: Floats, at: Floats, headings: Floats, stretch: float = 1.0) -> CentreLine:
        """From a pose `(3,)`, with headings relative to the start's, and all lengths times `stretch`."""
        absolute = start[2] + headings
        middle = 0.5 * (absolute[1:] + absolute[:-1])
        steps = (stretch * np.diff(at))[:, None] * np.column_stack([np.cos(middle), np.sin(middle)])
        return CentreLine(
            at, start[:2] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), absolute
        )

    def to_world(self, local: Floats) -> Floats:
        """Points `(n, 2)` of the part's frame (u, v) in the world; before the start and behind the end it goes on straight."""
        u = np.clip(local[:, 0], self.at[0], self.at[-1])
        x, y, yaw = (np.interp(u, self.at, v) for v in (*self.points.T, self.headings))
        along, across = local[:, 0] - u, local[:, 1]
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.column_stack([x + along * cos - across * sin, y + along * sin + across * cos])

    def to_local(self, points: Floats) -> Floats:
        """Points `(n, 2)` of the world in the part's frame, by the nearest point of the line."""
        first_points, step = self.points[:-1], np.diff(self.points, axis=0)
        lengths = np.hypot(*step.T)
        offset = points[:, None] - first_points
        along = np.einsum("nkc,kc->nk", offset, step / lengths[:, None])
        inside = np.clip(along, 0.0, lengths)
        nearest = np.argmin(((offset - (inside / lengths)[..., None] * step) ** 2).sum(axis=2), axis=1)
        rows = np.arange(len(points))
        first, last = nearest == 0, nearest == len(first_points) - 1
        part = along[rows, nearest] / lengths[nearest]
        part = np.clip(part, np.where(first, -np.inf, 0.0), np.where(last, np.inf, 1.0))
        u = self.at[nearest] + part * np.diff(self.at)[nearest]
        normal = np.column_stack([-step[:, 1], step[:, 0]]) / lengths[:, None]
        return np.column_stack([u, (offset[rows, nearest] * normal[nearest]).sum(axis=1)])

    @property
    def end(self) -> Floats:
        """The pose `(3,)` at the end."""
        return np.array([*self.points[-1], self.headings[-1]])


@dataclass(frozen=True)
class Building:
    """Its parts from one end to the other, and where each lies; the corridors are `2 * half` wide."""

    parts: list[Part]
    lines: list[CentreLine]
    half: float

    def part_of(self, points: Floats) -> tuple[NDArray[np.int64], Floats]:
        """The part `(n,)` in which points of the world lie, or to which they are nearest, and their place in its frame."""
        local = np.stack([line.to_local(points) for line in self.lines])
        outside = np.stack([_outside(part, uv) for part, uv in zip(self.parts, local, strict=True)])
        nearest = np.argmin(outside, axis=0)
        return nearest, local[nearest, np.arange(len(points))]

    def walls(self) -> list[Floats]:
        """All walls as polylines `(n, 2)` in the world."""
        pieces = []
        for part, line in zip(self.parts, self.lines, strict=True):
            local = [*part.walls, *(w for row in part.rows for room in row for w in walls_of(room))]
            pieces += [line.to_world(dense(wall)) for wall in local]
            for u, v, a, b in part.boxes:
                corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]]) / 2 + (u, v)
                pieces.append(line.to_world(corners))
        return pieces

    def route(self) -> Floats:
        """The robot's way points `(n, 2)`: through all parts to the end, and back."""
        pairs = list(zip(self.parts, self.lines, strict=True))
        out = [line.to_world(dense(part.routes[0])) for part, line in pairs]
        back = [line.to_world(dense(part.routes[1])) for part, line in reversed(pairs)]
        return np.concatenate(out + back)


def _outside(part: Part, local: Floats) -> Floats:
    """How far points lie outside of a part."""
    beyond = np.maximum(local - (part.length, part.extent[1]), (0.0, part.extent[0]) - local)
    return np.asarray(np.hypot(*np.maximum(beyond, 0.0).T) - 1e-3 * part.is_wing)


def dense(points: Floats, step: float = STEP_M) -> Floats:
    """A polyline with a point every `step`."""
    pieces = [
        a + np.linspace(0.0, 1.0, max(int(np.hypot(*(b - a)) / step), 1), endpoint=False)[:, None] * (b - a)
        for a, b in pairwise(points)
    ]
    return np.concatenate([*pieces, points[-1:]])


def walls_of(room: WingRoom, door_m: float = DOOR_M) -> list[Floats]:
    """The walls of a room; a shut door is a wall."""
    corners = room.contour
    if room.is_shut:
        return [corners]
    left, right = (np.array([room.door_u + side * 0.5 * door_m, room.front]) for side in (-1.0, 1.0))
    return [np.vstack([corners[:1], left]), np.vstack([right, corners[1:]])]


def building_of(seed: int) -> Building:
    """A building; the same seed gives the same one."""
    for attempt in range(100):
        rng = np.random.default_rng([seed, 19, attempt])
        half = float(rng.uniform(1.0, 1.4))
        parts = _parts(rng, half)
        lines = place_parts(parts, np.zeros(3))
        if not overlaps(parts, lines):
            return Building(parts, lines, half)
    raise AssertionError("no building without overlap")


def place_parts(parts: list[Part], start: Floats) -> list[CentreLine]:
    """The parts one behind the other."""
    lines: list[CentreLine] = []
    for part in parts:
        lines.append(CentreLine.of(lines[-1].end if lines else start, part.at, part.heading))
    return lines


def overlaps(parts: list[Part], lines: list[CentreLine]) -> bool:
    """Whether two parts that are not neighbours in the chain come close, or two neighbours lie over each other."""
    clouds = []
    for part, line in zip(parts, lines, strict=True):
        u = np.arange(0.5, part.length, 1.0)
        v = np.arange(part.extent[0] + 0.25, part.extent[1], 0.75)
        clouds.append(line.to_world(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)))
    for i, a in enumerate(clouds):
        for j, b in enumerate(clouds[i + 1 :], i + 1):
            near = 0.6 if j == i + 1 else GAP_M
            if np.hypot(*np.moveaxis(a[:, None] - b[None], -1, 0)).min() < near:
                return True
    return False


def _parts(rng: np.random.Generator, half: float) -> list[Part]:
    wings = int(rng.integers(2, MAX_WINGS + 1))
    parts: list[Part] = []
    for number in range(wings):
        if number:
            parts.append(_link(rng, half))
        ends = (number > 0, number < wings - 1)
        kind = rng.random()
        if kind < BLOCK:
            parts.append(_block_wing(rng, half, ends))
        elif kind < 0.85 or number == 0:
            parts.append(_corridor_wing(rng, half, ends))
        else:
            parts.append(_hall(rng, half, ends))
    return parts


def _link(rng: np.random.Generator, half: float) -> Part:
    """A corridor: straight, around a corner, an arc or an S."""
    length = float(rng.uniform(9.0, 18.0))
    kind = rng.integers(0, 4)
    t = np.linspace(0.0, 1.0, 33)
    side = float(rng.choice([-1.0, 1.0]))
    if kind == 0:
        heading = np.zeros(33)
    elif kind == 1:
        heading = side * np.radians(90.0) * np.clip((t - 0.5) * 6.0 + 0.5, 0.0, 1.0)
    elif kind == 2:
        heading = side * np.radians(rng.uniform(30.0, 75.0)) * t
    else:
        heading = side * np.radians(rng.uniform(25.0, 50.0)) * (1.0 - np.abs(2.0 * t - 1.0))
    walls = [np.array([[0.0, v], [length, v]]) for v in (-half, half)]
    middle = np.array([[0.0, 0.0], [length, 0.0]])
    return Part(length, (-half, half), [], walls, [], False, heading, (middle, middle[::-1]))


def _row(rng: np.random.Generator, span: tuple[float, float], front: float, back: float) -> list[WingRoom]:
    count = max(round((span[1] - span[0]) / float(rng.uniform(3.2, 5.5))), 1)
    widths = rng.uniform(0.7, 1.5, count)
    borders = span[0] + np.concatenate([[0.0], np.cumsum(widths * (span[1] - span[0]) / widths.sum())])
    rooms = []
    for u0, u1 in pairwise(borders.tolist()):
        door = float(rng.uniform(u0 + 0.9, u1 - 0.9)) if u1 - u0 > 1.8 else 0.5 * (u0 + u1)
        is_shut = bool(rng.random() < SHUT)
        rooms.append(
            WingRoom(u0, u1, front, back, door, is_shut, not is_shut and bool(rng.random() > UNVISITED))
        )
    return rooms


def _ends(half: float, width: float, length: float, ends: tuple[bool, bool]) -> list[Floats]:
    """The walls at both ends of a wing, with an opening where a corridor goes on."""
    walls = []
    for u, is_open in ((0.0, ends[0]), (length, ends[1])):
        spans = ((-width, -half), (half, width)) if is_open else ((-width, width),)
        walls += [np.array([[u, a], [u, b]]) for a, b in spans if b > a]
    return walls


def _visits(rooms: list[WingRoom], lane: float) -> list[list[float]]:
    """Way points from a lane along u into rooms and back, in the order of u."""
    points: list[list[float]] = []
    for room in sorted((r for r in rooms if r.is_visited), key=lambda r: r.door_u):
        depth = room.front + float(np.sign(room.back - room.front)) * min(
            2.2, 0.6 * abs(room.back - room.front)
        )
        middle = [0.5 * (room.u0 + room.u1), depth]
        door = [room.door_u, room.front]
        inside = [room.door_u, room.front + float(np.sign(room.back - room.front)) * 0.7]
        points += [[room.door_u, lane], door, inside, middle, inside, door, [room.door_u, lane]]
    return points


def _furniture(rng: np.random.Generator, rooms: list[WingRoom]) -> list[tuple[float, float, float, float]]:
    boxes = []
    for room in rooms:
        deep = abs(room.back - room.front)
        if rng.random() < 0.6 and room.u1 - room.u0 > 2.2 and deep > 3.8:
            size = float(rng.uniform(0.6, 1.6)), float(rng.uniform(0.4, 0.8))
            u = float(rng.uniform(room.u0 + 0.5 * size[0] + 0.1, room.u1 - 0.5 * size[0] - 0.1))
            boxes.append(
                (u, room.back - float(np.sign(room.back - room.front)) * (0.5 * size[1] + 0.05), *size)
            )
    return boxes


def _corridor_wing(rng: np.random.Generator, half: float, ends: tuple[bool, bool]) -> Part:
    length, depth = float(rng.uniform(14.0, 28.0)), float(rng.uniform(3.5, 6.0))
    other = depth if rng.random() < 0.5 else float(rng.uniform(3.5, 6.0))
    rows = [_row(rng, (0.0, length), half, half + depth), _row(rng, (0.0, length), -half, -half - other)]
    first, last = 0.8, length - 0.8
    out = np.array(
        [
            [0.0 if ends[0] else first, 0.0],
            *_visits(rows[0], 0.0),
            [last, 0.0],
            [length if ends[1] else last, 0.0],
        ]
    )
    back = np.array(
        [[0.0 if ends[0] else first, 0.0], *_visits(rows[1], 0.0), [length if ends[1] else last, 0.0]]
    )[::-1]
    walls = _ends(half, half, length, ends)
    boxes = _furniture(rng, rows[0] + rows[1])
    return Part(length, (-half - other, half + depth), rows, walls, boxes, True, np.zeros(2), (out, back))


def _block_wing(rng: np.random.Generator, half: float, ends: tuple[bool, bool]) -> Part:
    """A ring of corridors around two rows of rooms back to back, and rooms outside of it."""
    length, inner, depth = (float(rng.uniform(*r)) for r in ((20.0, 32.0), (3.5, 5.0), (3.5, 5.5)))
    lane = inner + half
    outer = lane + half
    inside = (2.0 * half, length - 2.0 * half)
    rows = [
        _row(rng, (0.0, length), outer, outer + depth),
        _row(rng, inside, inner, 0.0),
        _row(rng, inside, -inner, 0.0),
        _row(rng, (0.0, length), -outer, -outer - depth),
    ]
    walls = _ends(half, outer, length, ends)
    u0, u1 = half, length - half
    near_end, end = ([0.0 if ends[0] else u0, 0.0], [length if ends[1] else u1, 0.0])
    routes = [
        np.array(
            [
                near_end,
                [u0, 0.0],
                [u0, side * lane],
                *_visits(a + b, side * lane),
                [u1, side * lane],
                [u1, 0.0],
                end,
            ]
        )
        for side, a, b in ((1.0, rows[0], rows[1]), (-1.0, rows[2], rows[3]))
    ]
    boxes = _furniture(rng, rows[0] + rows[3])
    extent = (-outer - depth, outer + depth)
    return Part(length, extent, rows, walls, boxes, True, np.zeros(2), (routes[0], routes[1][::-1]))


def _hall(rng: np.random.Generator, half: float, ends: tuple[bool, bool]) -> Part:
    length, width = float(rng.uniform(8.0, 14.0)), float(rng.uniform(3.5, 6.0))
    walls = [np.array([[0.0, v], [length, v]]) for v in (-width, width)] + _ends(half, width, length, ends)
    box = (float(rng.uniform(3.0, length - 3.0)), float(rng.choice([-1, 1])) * (width - 0.6), 1.6, 0.8)
    around = [[0.0, 0.0], [1.5, 0.0], [1.5, 2.0], [length - 1.5, 2.0], [length - 1.5, 0.0]]
    out = np.array([*around, [length, 0.0]] if ends[1] else around)
    back = np.array([[0.0, 0.0], [1.5, 0.0], [1.5, -1.8], [length - 1.5, -1.8], out[-1].tolist()])[::-1]
    return Part(length, (-width, width), [], walls, [box], True, np.zeros(2), (out, back))


def drive_along(route: Floats, spacing_m: float) -> Floats:
    """Poses `(n, 3)` along a route, heading where it goes."""
    points = dense(route, spacing_m / 4)
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    unique = np.concatenate([[True], np.diff(at) > 1e-6])
    wanted = np.arange(0.0, at[-1], spacing_m)
    x, y = (np.interp(wanted, at[unique], v[unique]) for v in points.T)
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    return np.column_stack([x, y, se2.wrap_angle(yaw)])
