from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.maps.tag_database import TagDatabase, load_tag_database

BIN = """
  - id: bin-1
    class: bin
    footprint: [[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]]
    tags: [{id: t1, position: [0.2, 0]}, {id: t2, position: [-0.2, 0], facing_deg: 180}]
"""
DOOR = """
  - id: door-1
    class: door
    footprint: [[0, -0.02], [0.9, -0.02], [0.9, 0.02], [0, 0.02]]
    hinge: [0, 0]
    tags: [{id: t3}]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "tags.yaml"
    path.write_text(f"version: 1\nobjects:{text}")
    return path


def test_boxes_and_doors_with_several_tags_are_read(tmp_path: Path) -> None:
    database = load_tag_database(written(tmp_path, BIN + DOOR))
    box, door = database.objects
    assert (box.category, box.is_door, [tag.facing_deg for tag in box.tags]) == ("bin", False, [0.0, 180.0])
    assert door.is_door
    assert TagDatabase.model_validate(database.model_dump()) == database


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (BIN + BIN, "the object id 'bin-1' is given twice"),
        (BIN + DOOR.replace("t3", "t1"), "the tag id 't1' is given twice"),
        (BIN.replace("footprint", "footprin"), r"objects\.0\.footprin: no such key \(did you mean 'footprint'\?\)"),
        (BIN.replace("[0.2, -0.25], [0.2, 0.25]", "[0.4, -0.25], [0.6, -0.25]").replace("[-0.2, 0.25]", "[1, -0.25]"),
         "the footprint has no area"),
        (BIN.replace("0.25", "250"), "the footprint are metres from the object"),
        (BIN + "    closed_pose: [0, 0, 0]\n", "closed_pose is for doors"),
        (BIN.replace("0.2, 0]", ".nan, 0]"), "finite"),
    ],
)  # fmt: skip
def test_an_invalid_entry_is_named(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        load_tag_database(written(tmp_path, text))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml"):
        load_tag_database(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    "text",
    [
        DOOR.replace("hinge: [0, 0]", "hinge: [0, 1e300]"),
        DOOR.replace("hinge: [0, 0]", "hinge: [0, 0]\n    closed_pose: [1e9, 0, 0]"),
        BIN.replace("position: [0.2, 0]", "position: [21.0, 0]"),
    ],
)
def test_a_number_out_of_range_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="exceeds"):
        load_tag_database(written(tmp_path, text))


def test_an_empty_file_is_no_database(tmp_path: Path) -> None:
    (tmp_path / "tags.yaml").write_text("# nothing\n")
    with pytest.raises(ConfigError, match=r"is empty; expected .version: 1."):
        load_tag_database(tmp_path / "tags.yaml")
