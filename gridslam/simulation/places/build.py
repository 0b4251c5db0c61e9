"""From the section `place` of a world file to the document of a whole world."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from pydantic import ValidationError

from gridslam.config.base import StrictModel
from gridslam.config.errors import config_error
from gridslam.core.random import random_stream
from gridslam.simulation.driving.robot_config import Robot
from gridslam.simulation.places.campus import campus
from gridslam.simulation.places.config import Kind, Place
from gridslam.simulation.places.corridors import corridors
from gridslam.simulation.places.layout import Layout, rotation
from gridslam.simulation.places.office import office
from gridslam.simulation.places.travel import travel
from gridslam.simulation.places.vehicle import sensors, wheels
from gridslam.simulation.shapes import Person, Wall

Document = dict[str, Any]

LAYOUTS: dict[Kind, Callable[[np.random.Generator], Layout]] = {
    "office": office,
    "corridors": corridors,
    "campus": campus,
}
SPEEDS_MPS: dict[Kind, tuple[float, float]] = {
    "office": (0.8, 1.2),
    "corridors": (1.0, 1.4),
    "campus": (1.2, 1.7),
}
MAX_SHEAR = 0.06  # no place has its walls along the map's axes, nor all of them at right angles
DIGITS = 3  # decimals of coordinates (m) in a world document


class _PlaceSection(StrictModel):
    """Lets errors name the keys `place.kind` and so on."""

    place: Place


def with_place(document: Document, source: str, overridden: Collection[str] = ()) -> Document:
    """The document with its section `place` replaced by what that makes; keys that the document gives itself win.

    Raises ConfigError where the section is wrong.
    """
    if "place" not in document:
        return document
    given = {key: value for key, value in document.items() if key != "place"}
    try:
        place = _PlaceSection.model_validate({"place": document["place"]}).place
    except ValidationError as error:
        raise config_error(error, _PlaceSection, source, overridden) from None
    seed = place.seed
    if seed is None:
        seed = document.get("seed", 0) if isinstance(document.get("seed", 0), int) else 0
    return _merged(place_document(place.kind, seed, place.travel_m), given)


def place_document(kind: Kind, seed: int, travel_m: float) -> Document:
    """The document of the world of this kind and seed, with a route of about `travel_m`."""
    layout = _oriented(
        LAYOUTS[kind](random_stream(seed, f"place {kind}")), random_stream(seed, "place frame")
    )
    points, length_m = travel(layout, travel_m, random_stream(seed, "place travel"))
    rng = random_stream(seed, "place vehicle")
    slow, fast = SPEEDS_MPS[kind]
    points = [(round(x, DIGITS), round(y, DIGITS)) for x, y in points]
    (x0, y0), (x1, y1) = points[:2]
    robot = Robot(
        start=(x0, y0, math.degrees(math.atan2(y1 - y0, x1 - x0))),
        route=tuple(points[1:]),
        speed_mps=round(float(rng.uniform(slow, fast)), 2),
        turn_radps=1.2,
        wheels=wheels(points, rng),
    )
    walls = [
        Wall(
            points=tuple((x, y) for x, y in wall.corners.round(DIGITS).tolist()),
            closed=wall.closed,
            reflectivity=wall.reflectivity,
        )
        for wall in layout.walls
    ]
    people = [Person(path=path, speed_mps=round(float(rng.uniform(0.7, 1.4)), 2)) for path in layout.people]
    parts = {"walls": walls, "people": people, "robot": robot, "sensors": sensors(kind, rng)}
    document: Document = {
        "seed": seed,
        "max_duration_s": 600.0 + 5.0 * length_m,
        "truth": {"resolution_m": 0.1 if kind == "campus" else 0.05},
    }
    return document | {key: _dumped(part) for key, part in parts.items()}


def _oriented(layout: Layout, rng: np.random.Generator) -> Layout:
    """The layout turned and sheared by the seed."""
    shear = np.array([(1.0, float(rng.uniform(-MAX_SHEAR, MAX_SHEAR))), (0.0, 1.0)])
    return layout.transformed(rotation(float(rng.uniform(-math.pi, math.pi))) @ shear)


def _dumped(part: Any) -> Any:
    """Models as a document, without their default values."""
    if isinstance(part, list):
        return [_dumped(item) for item in part]
    return part.model_dump(mode="json", exclude_unset=True)


def _merged(made: Document, given: Document) -> Document:
    """Sections of both; where both give a value or a list, the given one."""
    merged = dict(made)
    for key, value in given.items():
        before = merged.get(key)
        merged[key] = (
            _merged(before, value) if isinstance(before, dict) and isinstance(value, dict) else value
        )
    return merged
