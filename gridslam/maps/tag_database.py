"""Reader of the tag database: the tagged objects of a place, as a YAML file.

```yaml
version: 1
objects:
  - id: bin-1
    class: bin
    footprint: [[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]]   # m, in the object's own frame
    tags: [{id: tag-bin-1, position: [0.2, 0], facing_deg: 0}]           # facing: direction of the tag's normal
  - id: door-1
    class: door
    footprint: [[0, -0.02], [0.9, -0.02], [0.9, 0.02], [0, 0.02]]
    hinge: [0, 0]                       # makes it a door: a leaf that rotates about this point
    closed_pose: [3.0, 1.5, 0]          # x, y, yaw in degrees in the map frame, if the hinge's position is known
    tags: [{id: tag-door-1, position: [0.3, -0.02], facing_deg: -90}]
```
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from pydantic import ConfigDict, Field, ValidationError, model_validator

from gridslam.config.base import StrictModel
from gridslam.config.errors import config_error
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError

Point = tuple[float, float]
MIN_AREA_M2 = 1e-4
MAX_SIZE_M = 20.0
MAX_COORDINATE = 1e6  # m or degrees, of a closed door


class ObjectTag(StrictModel):
    """A tag on an object: its position (m) and the direction of its normal (degrees) in the object's own frame."""

    id: str = Field(min_length=1, description="Name of the tag in the log's reads.")
    position: Point = Field((0.0, 0.0), description="Position in the object's frame: x, y in metres.")
    facing_deg: float = Field(
        0.0, description="Direction of the tag's normal in the object's frame, counter-clockwise in degrees."
    )


class TaggedObject(StrictModel):
    """An object: its class, its footprint in the plane of the lidar, its tags, and the hinge of a door."""

    former_keys: ClassVar[Mapping[str, str]] = {"outline": "footprint"}

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True, serialize_by_alias=True)

    id: str = Field(min_length=1, description="Name of the object in tables and pictures.")
    category: str = Field(
        min_length=1, alias="class", description="Class of the object, such as bin or door."
    )
    footprint: tuple[Point, ...] = Field(
        min_length=3,
        max_length=100,
        description="Corners of the object in the plane of the lidar, in its own frame: x, y in metres.",
    )
    tags: tuple[ObjectTag, ...] = Field(min_length=1, description="Tags on the object.")
    hinge: Point | None = Field(
        None,
        description="Point about which a door's leaf rotates, in its frame: x, y in metres. Absent: no door.",
    )
    closed_pose: tuple[float, float, float] | None = Field(
        None,
        description="Pose of a closed door in the map: x, y in metres, yaw in degrees. Absent: its position is estimated.",
    )

    @property
    def is_door(self) -> bool:
        """Whether the object is a door, which rotates about its hinge."""
        return self.hinge is not None

    @model_validator(mode="after")
    def _check_geometry(self) -> TaggedObject:
        if abs(_signed_area(self.footprint)) < MIN_AREA_M2:
            raise ValueError(f"object {self.id!r}: the footprint has no area")
        points = {"footprint": self.footprint, "tags' positions": tuple(tag.position for tag in self.tags)}
        for name, place in (points | {"hinge": (self.hinge or (0.0, 0.0),)}).items():
            if not max(abs(value) for point in place for value in point) <= MAX_SIZE_M:
                raise ValueError(
                    f"object {self.id!r}: the {name} are metres from the object; one exceeds {MAX_SIZE_M:g} m"
                )
        if self.closed_pose is not None and not max(map(abs, self.closed_pose)) <= MAX_COORDINATE:
            raise ValueError(f"object {self.id!r}: a number of closed_pose exceeds {MAX_COORDINATE:g}")
        if self.closed_pose is not None and self.hinge is None:
            raise ValueError(f"object {self.id!r}: closed_pose is for doors, and there is no hinge")
        return self


class TagDatabase(StrictModel):
    """The tagged objects of a place."""

    version: int = Field(1, ge=1, le=1, description="Version of this format.")
    objects: tuple[TaggedObject, ...] = Field((), description="The tagged objects.")

    @model_validator(mode="after")
    def _check_ids(self) -> TagDatabase:
        _refuse_duplicates("object id", [tagged.id for tagged in self.objects])
        _refuse_duplicates("tag id", [tag.id for tagged in self.objects for tag in tagged.tags])
        return self


def load_tag_database(path: Path) -> TagDatabase:
    """The database of a YAML file.

    Raises ConfigError: the file is missing, empty or invalid; the message names the line or the key.
    """
    document = read_yaml(path)
    if not document:
        raise ConfigError(f"{path}: is empty; expected `version: 1` and a list `objects`")
    try:
        return TagDatabase.model_validate(document)
    except ValidationError as error:
        raise config_error(error, TagDatabase, str(path)) from None


def _refuse_duplicates(kind: str, names: list[str]) -> None:
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise ValueError(f"the {kind} {repeated[0]!r} is given twice")


def _signed_area(footprint: tuple[Point, ...]) -> float:
    following = (*footprint[1:], footprint[0])
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(footprint, following, strict=True))
