"""Drawings of buildings as people make them, by seed, each with its true correspondence.

Every part of a building is drawn for itself: its lengths are stretched piece by piece along u and v, it shears at the borders of
rooms, it is rotated, and a corridor that is curved is drawn straight or with another curve. Rooms are left out, merged and
invented, doors are displaced, furniture is not drawn, and the hand is unsteady.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.drawings.drawing import RESOLUTION_M, Drawing
from tests.benchmarks.wing_buildings import Building, CentreLine, Part, WingRoom, dense, overlaps, walls_of

Floats = NDArray[np.float64]

# Of the logarithm: parts are stretched by up to 30 % either way, along u and v for themselves
WING_STRETCH = 0.26
PIECE_STRETCH = 0.12  # of the logarithm, from room to room
SHEAR = 0.08  # slope of v over u between two borders
ROTATION = 0.15  # of a part against the one before, rad
DRAWN_STRAIGHT = 0.7  # fraction of the curved corridors
LEFT_OUT, MERGED, INVENTED, UNDRAWN_DOOR = 0.12, 0.1, 0.1, 0.05
DOOR_SHIFT_M = 0.4
TREMOR_M = 0.1  # of the hand, in metres of the building
MARGIN_PX = 25


@dataclass(frozen=True)
class DrawnPart:
    """Where a part lies on the paper (lengths in drawn metres): knots of u and v, the shear over u, and the centre line."""

    u: Floats
    drawn_u: Floats
    v: Floats
    drawn_v: tuple[Floats, Floats]  # at its start and its end
    shear: Floats
    line: CentreLine

    def to_paper(self, local: Floats) -> Floats:
        """Points `(n, 2)` of the part's frame on the paper; outside of the part the first and last piece go on."""
        u = _piecewise(local[:, 0], self.u, self.drawn_u)
        start, end = (_piecewise(local[:, 1], self.v, drawn) for drawn in self.drawn_v)
        along = np.clip((local[:, 0] - self.u[0]) / (self.u[-1] - self.u[0]), 0.0, 1.0)
        v = start + along * (end - start) + np.interp(local[:, 0], self.u, self.shear)
        return self.line.to_world(np.column_stack([u, v]))

    @property
    def exit_pose(self) -> Floats:
        """The pose `(3,)` on the paper at the end of the corridor."""
        end = np.array([[self.u[-1] - 1e-3, 0.0], [self.u[-1], 0.0]])
        a, b = self.to_paper(end)
        return np.array([*b, np.arctan2(*(b - a)[::-1])])


@dataclass(frozen=True)
class PeopleDrawing:
    """A picture, and where the points of the building lie in it."""

    drawing: Drawing
    building: Building
    parts: list[DrawnPart]
    scale: float  # drawing units per drawn metre
    origin: Floats  # of the paper in the picture, drawing units

    def in_drawing(self, points: Floats) -> Floats:
        """Points `(n, 2)` of the building (m) in the drawing (drawing units)."""
        numbers, local = self.building.part_of(points)
        placed = np.empty_like(points)
        for number, part in enumerate(self.parts):
            mine = numbers == number
            placed[mine] = part.to_paper(local[mine])
        return placed * self.scale + self.origin

    def pose_in_drawing(self, pose: Floats) -> tuple[float, float, float]:
        """A pose of the building `(3,)` in the drawing."""
        step = 0.05 * np.array([np.cos(pose[2]), np.sin(pose[2])])
        here, ahead = self.in_drawing(np.stack([pose[:2], pose[:2] + step]))
        return float(here[0]), float(here[1]), float(np.arctan2(*(ahead - here)[::-1]))

    def errors_m(self, points: Floats, drawn: Floats) -> Floats:
        """Distances `(n,)` in metres of the building between its points `(n, 2)` and estimates of them in the drawing `(n, 2)`.

        The estimates are mapped back by the correspondence about each point, linearised.
        """
        at = self.in_drawing(points)
        step = 0.1
        columns = []
        for axis in np.eye(2):  # within the piece in which the point lies
            numbers, _ = self.building.part_of(points)
            moved = points + step * axis
            there, behind = np.empty_like(at), np.empty_like(at)
            for number, part in enumerate(self.parts):
                mine = numbers == number
                line = self.building.lines[number]
                there[mine] = part.to_paper(line.to_local(moved[mine]))
                behind[mine] = part.to_paper(line.to_local((points - step * axis)[mine]))
            columns.append((there - behind) * self.scale / (2.0 * step))
        jacobians = np.stack(columns, axis=-1)
        return np.asarray(np.hypot(*np.linalg.solve(jacobians, (drawn - at)[..., None])[..., 0].T))


def _piecewise(values: Floats, knots: Floats, drawn: Floats) -> Floats:
    """Piecewise linear, with the first and last piece going on."""
    inside = np.interp(values, knots, drawn)
    low, high = ((drawn[i + 1] - drawn[i]) / (knots[i + 1] - knots[i]) for i in (0, -2))
    return np.asarray(
        inside + low * np.minimum(values - knots[0], 0.0) + high * np.maximum(values - knots[-1], 0.0)
    )


def drawing_of(building: Building, seed: int) -> PeopleDrawing:
    """A drawing of a building; the same seed gives the same one."""
    for attempt in range(200):
        rng = np.random.default_rng([seed, 23, attempt])
        parts = _drawn_parts(building, rng)
        stand_ins = [
            Part(p.u[-1], (float(p.v[0]), float(p.v[-1])), is_wing=q.is_wing)
            for p, q in zip(parts, building.parts, strict=True)
        ]
        if not overlaps(stand_ins, [_OnPaper(p) for p in parts]):  # type: ignore[misc]
            return _on_paper(building, parts, rng, seed)
    raise AssertionError("no drawing without overlap")


@dataclass(frozen=True)
class _OnPaper:
    part: DrawnPart

    def to_world(self, local: Floats) -> Floats:
        return self.part.to_paper(local)


def _drawn_parts(building: Building, rng: np.random.Generator) -> list[DrawnPart]:
    pose = np.array([0.0, 0.0, float(rng.choice([0.0, 0.5, 1.0, 1.5])) * np.pi + rng.uniform(-0.06, 0.06)])
    drawn: list[DrawnPart] = []
    widths = []  # stretch along v of the corridor at the start and end of each part
    stretches = np.exp(rng.uniform(-WING_STRETCH, WING_STRETCH, (len(building.parts), 2)))
    for number, part in enumerate(building.parts):
        if part.is_wing:
            widths.append((stretches[number, 1], stretches[number, 1]))
        else:
            widths.append((stretches[number - 1, 1], stretches[number + 1, 1]))
    for number, part in enumerate(building.parts):
        start = pose + np.array([0.0, 0.0, rng.uniform(-ROTATION, ROTATION) if number else 0.0])
        piece = _drawn_part(part, start, stretches[number, 0], widths[number], rng)
        drawn.append(piece)
        pose = piece.exit_pose
    return drawn


def _drawn_part(
    part: Part, start: Floats, stretch: float, widths: tuple[float, float], rng: np.random.Generator
) -> DrawnPart:
    rooms = [room for row in part.rows for room in row]
    borders = np.unique(
        np.round([0.0, part.length, *(r.u0 for r in part.rows[0])] if rooms else [0.0, part.length], 3)
    )
    u = borders if part.is_wing else part.at
    lengths = np.diff(u) * stretch
    if part.is_wing:
        lengths = lengths * np.exp(rng.uniform(-PIECE_STRETCH, PIECE_STRETCH, len(lengths)))
    drawn_u = np.concatenate([[0.0], np.cumsum(lengths)])
    v = np.unique(np.round([*part.extent, 0.0, *(r.front for r in rooms)], 3))
    factors = np.exp(rng.uniform(-PIECE_STRETCH, PIECE_STRETCH, len(v) - 1))
    knots = np.concatenate([[0.0], np.cumsum(np.diff(v) * factors)])
    knots -= knots[int(np.searchsorted(v, 0.0))]
    shear = np.concatenate([[0.0], np.cumsum(np.diff(drawn_u) * rng.uniform(-SHEAR, SHEAR, len(u) - 1))])
    if not part.is_wing:
        shear = np.zeros(len(u))
    heading = part.heading
    if np.ptp(heading) > 0.0 and not np.isclose(abs(heading[-1]), np.pi / 2):  # corners are drawn as corners
        heading = np.zeros(len(u)) if rng.random() < DRAWN_STRAIGHT else heading * rng.uniform(0.5, 1.3)
    line = CentreLine.of(start, drawn_u, heading if not part.is_wing else np.zeros(len(u)))
    return DrawnPart(u, drawn_u, v, (knots * widths[0], knots * widths[1]), shear, line)


def _drawn_rows(part: Part, rng: np.random.Generator) -> tuple[list[WingRoom], list[Floats], list[Floats]]:
    """The rooms that are drawn, the fronts of those left out, and the outlines of those invented."""
    rooms: list[WingRoom] = []
    fronts: list[Floats] = []
    invented: list[Floats] = []
    for row in part.rows:
        kept = list(row)
        for number in range(len(kept) - 1, 0, -1):
            if rng.random() < MERGED:
                a, b = kept[number - 1], kept.pop(number)
                kept[number - 1] = replace(a, u1=b.u1)
        for room in kept:
            if rng.random() < LEFT_OUT and len(kept) > 1:
                fronts.append(np.array([[room.u0, room.front], [room.u1, room.front]]))
                continue
            door = float(np.clip(room.door_u + rng.normal(0.0, DOOR_SHIFT_M), room.u0 + 0.7, room.u1 - 0.7))
            rooms.append(replace(room, door_u=door, is_shut=bool(rng.random() < UNDRAWN_DOOR)))
            if rng.random() < INVENTED and room.u1 - room.u0 > 3.0:  # a wall through the room
                middle = door + float(rng.choice([-1.0, 1.0])) * 0.9
                if room.u0 + 0.5 < middle < room.u1 - 0.5:
                    invented.append(np.array([[middle, room.front], [middle, room.back]]))
            outer = abs(room.back) >= max(abs(e) for e in part.extent) - 1e-6
            if outer and rng.random() < INVENTED:  # a room behind the room
                behind = room.back + float(np.sign(room.back)) * 2.5
                invented.append(
                    np.array(
                        [[room.u0, room.back], [room.u0, behind], [room.u1, behind], [room.u1, room.back]]
                    )
                )
    return rooms, fronts, invented


def _on_paper(
    building: Building, parts: list[DrawnPart], rng: np.random.Generator, seed: int
) -> PeopleDrawing:
    strokes: list[Floats] = []
    for part, drawn in zip(building.parts, parts, strict=True):
        rooms, fronts, invented = _drawn_rows(part, rng)
        door_m = float(rng.uniform(0.9, 1.5))
        local = [*part.walls, *fronts, *invented, *(w for room in rooms for w in walls_of(room, door_m))]
        strokes += [drawn.to_paper(dense(wall)) for wall in local]
    strokes = [_unsteady(stroke, rng_of_hand) for rng_of_hand in [_Hand(rng)] for stroke in strokes]
    scale = float(rng.uniform(0.8, 1.6))
    everything = np.concatenate(strokes)
    low, high = everything.min(axis=0), everything.max(axis=0)
    origin = MARGIN_PX * RESOLUTION_M - low * scale
    cols, rows = (np.ceil((high - low) * scale / RESOLUTION_M).astype(int) + 2 * MARGIN_PX).tolist()
    levels = np.full((rows, cols), 255, np.uint8)
    pen = int(rng.integers(1, 4))
    for stroke in strokes:
        pixels = (stroke * scale + origin) / RESOLUTION_M - 0.5
        cv2.polylines(levels, [np.rint(pixels * 16).astype(np.int32)], False, 20, pen, cv2.LINE_AA, 4)
    return PeopleDrawing(Drawing(levels, f"drawing {seed}"), building, parts, scale, origin)


class _Hand:
    """A smooth random displacement of strokes that cross the same place, and a slip of the pen for each."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.waves = rng.normal(0.0, 1.2, (6, 2))
        self.phases = rng.uniform(0.0, 2.0 * np.pi, (6, 2))


def _unsteady(stroke: Floats, hand: _Hand) -> Floats:
    phase = stroke @ hand.waves.T
    smooth = np.stack([np.sin(phase + hand.phases[:, k]).sum(axis=1) for k in (0, 1)], axis=1)
    slip = hand.rng.normal(0.0, 0.3 * TREMOR_M, 2)
    return np.asarray(stroke + TREMOR_M / np.sqrt(3.0) * smooth + slip)
