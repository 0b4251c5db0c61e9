from __future__ import annotations

from pathlib import Path

import numpy as np

from gridslam.maps.tag_database import load_tag_database
from gridslam.simulation.tag_database import tag_database_yaml
from gridslam.simulation.world_config import load_world

SAMPLE = Path(__file__).resolve().parents[2] / "sample_logs" / "slam-sd-tags.truth" / "tags.yaml"


def test_a_world_gives_the_database_of_its_tagged_objects(tmp_path: Path) -> None:
    world, _ = load_world("sd-corridor-long")
    (tmp_path / "tags.yaml").write_text(tag_database_yaml(world))
    database = load_tag_database(tmp_path / "tags.yaml")
    assert [obj.id for obj in database.objects] == [obj.id for obj in world.movable_objects]
    assert sum(obj.is_door for obj in database.objects) == len(world.doors)
    for door, entry in zip(world.doors, database.objects, strict=False):
        assert np.ptp([x for x, _ in entry.footprint]) == door.width_m
        assert entry.category == door.kind


def test_the_sample_log_has_the_database_of_its_world() -> None:
    world, _ = load_world("sd-corridor-short")
    assert SAMPLE.read_text() == tag_database_yaml(world)
