"""The tag database of a world: doors and tagged objects as their owner would describe them."""

from __future__ import annotations

import yaml

from gridslam.simulation.shapes import Door, MovableObject
from gridslam.simulation.world_config import WorldConfig


def tag_database_yaml(world: WorldConfig) -> str:
    """The database as YAML text; it does not hold where the objects are."""
    objects = [_entry(obj) for obj in world.movable_objects if obj.tag]
    document = {"version": 1, "objects": objects}
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)


def _entry(obj: Door | MovableObject) -> dict[str, object]:
    assert obj.tag is not None
    tag = {"id": obj.tag.id, "position": list(obj.tag.position), "facing_deg": obj.tag.facing_deg}
    if isinstance(obj, Door):
        half = 0.5 * obj.thickness_m
        corners = [[0.0, -half], [obj.width_m, -half], [obj.width_m, half], [0.0, half]]
        entry = {"id": obj.id, "class": obj.kind, "footprint": corners, "hinge": [0.0, 0.0]}
    else:
        x, y = 0.5 * obj.size[0], 0.5 * obj.size[1]
        entry = {"id": obj.id, "class": obj.kind, "footprint": [[-x, -y], [x, -y], [x, y], [-x, y]]}
    return {**entry, "tags": [tag]}
