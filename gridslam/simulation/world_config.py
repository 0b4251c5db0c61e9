"""The model of a world file, read from YAML or by the name of a built-in world."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError, model_validator

from gridslam.config.base import StrictModel
from gridslam.config.errors import config_error, nearest
from gridslam.config.overrides import apply_overrides, overridden_keys
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError
from gridslam.core.stamps import NS_PER_S
from gridslam.simulation.driving.robot_config import Robot
from gridslam.simulation.places.build import with_place
from gridslam.simulation.sensors.camera_config import RgbdCamera
from gridslam.simulation.sensors.sensor_suite import Sensors
from gridslam.simulation.shapes import (
    Box,
    Cylinder,
    Door,
    MovableObject,
    NotNegative,
    Person,
    Point,
    Positive,
    Wall,
)
from gridslam.simulation.work import refuse_slow


class FloorPlan(StrictModel):
    """Walls taken from a map_server YAML, or from an image of a floor plan with the size of its pixels."""

    file: str = Field(min_length=1)
    resolution_m: Positive | None = None  # size of an image's pixel; a map states its own
    origin: Point = (0.0, 0.0)  # lower-left corner of an image
    walls_are: str = Field(default="dark", pattern="^(dark|bright)$")
    simplify_m: NotNegative = 0.05


class TruthMap(StrictModel):
    """Resolution and margin of the true map."""

    resolution_m: Positive = 0.05
    margin_m: NotNegative = 1.0


class WorldConfig(StrictModel):
    """A place, what moves in it, a robot and its sensors."""

    version: Annotated[int, Field(ge=1, le=1)] = 1
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    start_ns: Annotated[int, Field(ge=0, le=(2**31 - 86_400) * NS_PER_S)] = 1_700_000_000_000_000_000
    max_duration_s: Annotated[float, Field(gt=0.0, le=86_400.0)] = 3600.0
    plan: FloorPlan | None = None
    walls: tuple[Wall, ...] = ()
    boxes: tuple[Box, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    doors: tuple[Door, ...] = ()
    objects: tuple[MovableObject, ...] = ()
    people: tuple[Person, ...] = ()
    fixed_cameras: tuple[RgbdCamera, ...] = ()  # their extrinsics are in the map frame
    robot: Robot
    sensors: Sensors = Sensors()
    truth: TruthMap = TruthMap()

    @property
    def movable_objects(self) -> list[Door | MovableObject]:
        """Doors and objects: everything that the world file can move."""
        return [*self.doors, *self.objects]

    @model_validator(mode="after")
    def _consistent(self) -> WorldConfig:
        named = self.movable_objects
        _refuse_twice("id", [obj.id for obj in named])
        _refuse_twice("tag id", [obj.tag.id for obj in named if obj.tag])
        _refuse_twice("infrared name", [ranger.name for ranger in self.sensors.infrared])
        _refuse_twice("antenna name", [antenna.name for antenna in self.sensors.antennas])
        cameras = [*self.sensors.cameras, *self.fixed_cameras]
        _refuse_twice("camera name", [camera.name for camera in cameras])
        if self.robot.stops and not self.sensors.infrared:
            raise ValueError("robot.stops: only infrared rangers need stops, and there are none")
        if self.sensors.infrared and not self.robot.stops:
            raise ValueError("sensors.infrared: rangers sweep while the robot stands; robot.stops is missing")
        if not (self.plan or self.walls or self.boxes):
            raise ValueError("the world is empty: it has neither plan nor walls nor boxes")
        refuse_slow(self)
        return self


def _refuse_twice(what: str, names: Sequence[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"the {what} {twice[0]!r} is given twice")


def builtin_worlds() -> list[str]:
    """Names of the worlds that ship with the program."""
    folder = files("gridslam.configs").joinpath("worlds")
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))


def load_world(
    name_or_path: str, overrides: Sequence[str] = (), seed: int | None = None
) -> tuple[WorldConfig, Path]:
    """The world of a file or of a built-in name, and the path of its file, to which its own paths are relative.

    Raises ConfigError: no such world, invalid YAML, or a wrong key or value, with its key path.
    """
    path = _path_of(name_or_path)
    document = apply_overrides(read_yaml(path), overrides)
    return _world_of(document, name_or_path, overrides, seed), path


def load_worlds(
    name_or_path: str, overrides: Sequence[str], seeds: Sequence[int]
) -> Iterator[tuple[WorldConfig, Path]]:
    """Worlds and paths, as of `load_world`, for each of the seeds.

    The file is read once, and checked again only where a place is made by the seed.
    """
    path = _path_of(name_or_path)
    document = apply_overrides(read_yaml(path), overrides)
    world: WorldConfig | None = None
    for seed in seeds:
        if world is None or "place" in document:
            world = _world_of(document, name_or_path, overrides, seed)
        yield world.model_copy(update={"seed": seed}), path


def _world_of(
    document: dict[str, Any], source: str, overrides: Sequence[str], seed: int | None
) -> WorldConfig:
    given = document if seed is None else {**document, "seed": seed}
    return validate_world(with_place(given, source, overridden_keys(overrides)), source, overrides)


def validate_world(document: dict[str, Any], source: str, overrides: Sequence[str] = ()) -> WorldConfig:
    """The checked world of a document. Raises ConfigError with the key path and what is wrong there."""
    try:
        return WorldConfig.model_validate(document)
    except ValidationError as error:
        raise config_error(error, WorldConfig, source, overridden_keys(overrides)) from None


def _path_of(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if path.exists():
        return path
    if name_or_path in builtin_worlds():
        with as_file(files("gridslam.configs").joinpath("worlds", f"{name_or_path}.yaml")) as found:
            return found
    hint = nearest(path.name.removesuffix(".yaml"), builtin_worlds())
    raise ConfigError(f"{name_or_path}: neither a world file nor a built-in world{hint}")
