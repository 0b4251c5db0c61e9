"""What stands in a world: the sections of a world file about walls, furniture, doors, tagged objects and people.

Lengths are metres in the map frame, angles degrees counter-clockwise (names end in `_deg`). Heights matter to cameras only.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, model_validator

from gridslam.config.base import StrictModel

Point = tuple[float, float]
PoseDeg = tuple[float, float, float]  # x, y (m), yaw (degrees)
Share = Annotated[float, Field(ge=0.0, le=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Opening = Annotated[float, Field(ge=-180.0, le=180.0)]  # degrees
WayPoint = Annotated[int, Field(ge=0)]

Texture = Literal["plain", "plaster", "wood", "brick", "checks", "carpet"]


class Surface(StrictModel):
    """How a surface looks: to the lidar (share of light sent back) and to cameras."""

    reflectivity: Share = 0.7
    texture: Texture = "plaster"
    colour: tuple[int, int, int] = (200, 195, 185)


class Wall(Surface):
    """A polyline or a rectangle (x0, y0, x1, y1) of walls without thickness."""

    points: tuple[Point, ...] = Field(default=(), max_length=10_000)
    rectangle: tuple[float, float, float, float] | None = None
    closed: bool = False
    height_m: PositiveFloat = 2.5

    @model_validator(mode="after")
    def _one_shape(self) -> Wall:
        if (self.rectangle is None) == (len(self.points) < 2):
            raise ValueError("a wall has either two or more points, or a rectangle [x0, y0, x1, y1]")
        if any(a == b for a, b in zip(self.points, self.points[1:], strict=False)):
            raise ValueError("two points that follow each other are equal")
        if self.rectangle is not None and (
            self.rectangle[0] >= self.rectangle[2] or self.rectangle[1] >= self.rectangle[3]
        ):
            raise ValueError("rectangle: expected x0 < x1 and y0 < y1")
        return self


class Box(Surface):
    """A piece of furniture with a rectangular outline."""

    centre: Point
    size: tuple[PositiveFloat, PositiveFloat]  # along its own x and y
    yaw_deg: float = 0.0
    height_m: PositiveFloat = 1.0
    colour: tuple[int, int, int] = (150, 110, 70)
    texture: Texture = "wood"


class Cylinder(Surface):
    """A pillar, a round table, a plant."""

    centre: Point
    radius_m: PositiveFloat
    height_m: PositiveFloat = 2.5


class Tag(StrictModel):
    """An RFID tag on an object, in the object's own frame."""

    id: str = Field(min_length=1)
    position: Point = (0.0, 0.0)
    facing_deg: float = 0.0  # direction of the tag's normal


class Door(Surface):
    """A leaf on a hinge: closed it points along `closed_deg`, opened it is turned by `opening_deg` (either sign)."""

    id: str = Field(min_length=1)
    hinge: Point
    width_m: PositiveFloat = 0.9
    thickness_m: PositiveFloat = 0.04
    closed_deg: float = 0.0
    opening_deg: Opening = 0.0
    kind: str = "door"
    tag: Tag | None = None
    turns: dict[WayPoint, Annotated[float, Field(ge=-180.0, le=180.0)]] = Field(
        default_factory=dict
    )  # way point reached: opening
    height_m: PositiveFloat = 2.0
    colour: tuple[int, int, int] = (120, 80, 50)
    texture: Texture = "wood"


class TaggedObject(Surface):
    """A thing with a rectangular outline that may be elsewhere at the robot's next visit."""

    id: str = Field(min_length=1)
    kind: str = "bin"
    pose: PoseDeg
    size: tuple[PositiveFloat, PositiveFloat]
    tag: Tag | None = None
    moves: dict[WayPoint, PoseDeg] = Field(default_factory=dict)  # way point reached: the new pose
    height_m: PositiveFloat = 0.8
    colour: tuple[int, int, int] = (60, 90, 140)
    texture: Texture = "plain"


class Person(StrictModel):
    """Somebody who walks along a path and back, with a speed that changes at random; the lidar sees two legs."""

    path: tuple[Point, ...] = Field(min_length=2)
    speed_mps: PositiveFloat = 1.0
    speed_deviation_mps: NotNegative = 0.2
    leg_radius_m: PositiveFloat = 0.07
    body_radius_m: PositiveFloat = 0.22
    height_m: PositiveFloat = 1.75
    starts_at_s: NotNegative = 0.0
    colour: tuple[int, int, int] = (170, 60, 60)
