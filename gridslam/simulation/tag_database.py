"""The tag database that a world implies: what its owner would know of doors and tagged objects."""

from __future__ import annotations

import yaml

from gridslam.simulation.shapes import Door, TaggedObject
from gridslam.simulation.world_config import World


def tag_database_yaml(world: World) -> str:
    """The YAML text; where things stand is not in it."""
    objects = [_entry(thing) for thing in world.things if thing.tag]
    document = {"version": 1, "objects": objects}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)


def _entry(thing: Door | TaggedObject) -> dict[str, object]:
    assert thing.tag is not None
    tag = {"id": thing.tag.id, "position": list(thing.tag.position), "facing_deg": thing.tag.facing_deg}
    if isinstance(thing, Door):
        half = 0.5 * thing.thickness_m
        corners = [[0.0, -half], [thing.width_m, -half], [thing.width_m, half], [0.0, half]]
        entry = {"id": thing.id, "class": thing.kind, "outline": corners, "hinge": [0.0, 0.0]}
    else:
        x, y = 0.5 * thing.size[0], 0.5 * thing.size[1]
        entry = {"id": thing.id, "class": thing.kind, "outline": [[-x, -y], [x, -y], [x, y], [-x, y]]}
    return {**entry, "tags": [tag]}
