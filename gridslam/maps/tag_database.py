"""The tag database: what the user knows of the tagged objects of a place, read from YAML.

```yaml
version: 1
objects:
  - id: bin-1
    class: bin
    outline: [[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]]   # m, in the object's own frame
    tags: [{id: tag-bin-1, position: [0.2, 0], facing_deg: 0}]           # facing: direction of the tag's normal
  - id: door-1
    class: door
    outline: [[0, -0.02], [0.9, -0.02], [0.9, 0.02], [0, 0.02]]
    hinge: [0, 0]                       # makes it a door: a leaf that turns about this point
    closed_pose: [3.0, 1.5, 0]          # x, y, yaw in degrees in the map frame, where the hinge's place is known
    tags: [{id: tag-door-1, position: [0.3, -0.02], facing_deg: -90}]
```
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field, ValidationError, model_validator

from gridslam.config.base import StrictModel
from gridslam.config.errors import config_error
from gridslam.config.yaml_file import read_yaml

Point = tuple[float, float]
LEAST_AREA_M2 = 1e-4
LARGEST_M = 20.0


class ObjectTag(StrictModel):
    """A tag on an object: where it is (m) and where its normal points (degrees), in the object's own frame."""

    id: str = Field(min_length=1)
    position: Point = (0.0, 0.0)
    facing_deg: float = 0.0


class TaggedObject(StrictModel):
    """An object: its class, its outline in the plane of the lidar, its tags, and a door's hinge."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True, serialize_by_alias=True)

    id: str = Field(min_length=1)
    category: str = Field(min_length=1, alias="class")
    outline: Annotated[tuple[Point, ...], Field(min_length=3, max_length=100)]
    tags: Annotated[tuple[ObjectTag, ...], Field(min_length=1)]
    hinge: Point | None = None
    closed_pose: tuple[float, float, float] | None = None

    @property
    def is_door(self) -> bool:
        """Whether it is a leaf on a hinge."""
        return self.hinge is not None

    @model_validator(mode="after")
    def _possible(self) -> TaggedObject:
        if abs(_signed_area(self.outline)) < LEAST_AREA_M2:
            raise ValueError(f"object {self.id!r}: the outline has no area")
        if max(abs(value) for point in self.outline for value in point) > LARGEST_M:
            raise ValueError(
                f"object {self.id!r}: the outline is given in metres; this one exceeds {LARGEST_M:g} m"
            )
        if self.closed_pose is not None and self.hinge is None:
            raise ValueError(f"object {self.id!r}: closed_pose is for doors, and there is no hinge")
        return self


class TagDatabase(StrictModel):
    """All tagged objects of a place."""

    version: Annotated[int, Field(ge=1, le=1)] = 1
    objects: tuple[TaggedObject, ...] = ()

    @model_validator(mode="after")
    def _unambiguous(self) -> TagDatabase:
        _refuse_twice("object id", [thing.id for thing in self.objects])
        _refuse_twice("tag id", [tag.id for thing in self.objects for tag in thing.tags])
        return self


def load_tag_database(path: Path) -> TagDatabase:
    """The database of a YAML file; ConfigError names the file and the line or key path of what is wrong."""
    try:
        return TagDatabase.model_validate(read_yaml(path))
    except ValidationError as error:
        raise config_error(error, TagDatabase, str(path)) from None


def _refuse_twice(what: str, names: list[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"the {what} {twice[0]!r} is given twice")


def _signed_area(outline: tuple[Point, ...]) -> float:
    following = (*outline[1:], outline[0])
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(outline, following, strict=True))
