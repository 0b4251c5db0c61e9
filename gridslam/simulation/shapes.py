"""Sections of a world file: walls, furniture, doors, movable objects and people.

Lengths are metres in the map frame, angles degrees counter-clockwise (names end in `_deg`). Only cameras use heights.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from gridslam.config.base import StrictModel

LARGEST, SMALLEST = 1e6, 1e-6  # of any number of a world, and of one that must be positive

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST)]
Positive = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Rate = Annotated[float, Field(ge=0.001, le=100.0)]  # Hz
Level = Annotated[int, Field(ge=0, le=255)]
Colour = tuple[Level, Level, Level]
Point = tuple[Number, Number]
PoseDeg = tuple[Number, Number, Number]  # x, y (m), yaw (degrees)
Opening = Annotated[float, Field(ge=-180.0, le=180.0)]  # degrees
WaypointIndex = Annotated[int, Field(ge=0)]

Texture = Literal["plain", "plaster", "wood", "brick", "checks", "carpet"]


class Surface(StrictModel):
    """Appearance of a surface: reflectivity for the lidar, texture and colour for cameras."""

    reflectivity: Fraction = 0.7
    texture: Texture = "plaster"
    colour: Colour = (200, 195, 185)


class Wall(Surface):
    """Walls without thickness: a polyline, or a rectangle (x0, y0, x1, y1)."""

    points: tuple[Point, ...] = Field(default=(), max_length=10_000)
    rectangle: tuple[Number, Number, Number, Number] | None = None
    closed: bool = False
    height_m: Positive = 2.5

    @model_validator(mode="after")
    def _one_shape(self) -> Wall:
        if (self.rectangle is None) == (len(self.points) < 2):
            raise ValueError("a wall has either two or more points, or a rectangle [x0, y0, x1, y1]")
        if any(a == b for a, b in zip(self.points, self.points[1:], strict=False)):
            raise ValueError("two consecutive points are equal")
        if self.rectangle is not None and (
            self.rectangle[0] >= self.rectangle[2] or self.rectangle[1] >= self.rectangle[3]
        ):
            raise ValueError("rectangle: expected x0 < x1 and y0 < y1")
        return self


class Box(Surface):
    """A piece of furniture with a rectangular footprint."""

    centre: Point
    size: tuple[Positive, Positive]  # along its own x and y
    yaw_deg: Number = 0.0
    height_m: Positive = 1.0
    colour: Colour = (150, 110, 70)
    texture: Texture = "wood"


class Cylinder(Surface):
    """A pillar, a round table, a plant."""

    centre: Point
    radius_m: Positive
    height_m: Positive = 2.5


class Tag(StrictModel):
    """An RFID tag on an object, in the object's frame."""

    id: str = Field(min_length=1)
    position: Point = (0.0, 0.0)
    facing_deg: Number = 0.0  # direction of the tag's normal


class Door(Surface):
    """A leaf on a hinge. Closed, it points along `closed_deg`; it is opened by `opening_deg`, of either sign."""

    former_keys: ClassVar[Mapping[str, str]] = {"turns": "openings_deg"}

    id: str = Field(min_length=1)
    hinge: Point
    width_m: Positive = 0.9
    thickness_m: Positive = 0.04
    closed_deg: Number = 0.0
    opening_deg: Opening = 0.0
    kind: str = "door"
    tag: Tag | None = None
    openings_deg: dict[WaypointIndex, Opening] = Field(default_factory=dict)  # waypoint reached: opening
    height_m: Positive = 2.0
    colour: Colour = (120, 80, 50)
    texture: Texture = "wood"


class MovableObject(Surface):
    """An object with a rectangular footprint, moved when the robot reaches the waypoints in `moves`."""

    id: str = Field(min_length=1)
    kind: str = "bin"
    pose: PoseDeg
    size: tuple[Positive, Positive]
    tag: Tag | None = None
    moves: dict[WaypointIndex, PoseDeg] = Field(default_factory=dict)  # waypoint reached: the new pose
    height_m: Positive = 0.8
    colour: Colour = (60, 90, 140)
    texture: Texture = "plain"


class Person(StrictModel):
    """A person who walks along a path and back at a random speed; the lidar sees two legs."""

    path: tuple[Point, ...] = Field(min_length=2)
    speed_mps: Positive = 1.0
    speed_deviation_mps: NotNegative = 0.2
    leg_radius_m: Positive = 0.07
    body_radius_m: Positive = 0.22
    height_m: Positive = 1.75
    starts_at_s: NotNegative = 0.0
    colour: Colour = (170, 60, 60)
