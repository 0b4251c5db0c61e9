from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import Event, Image, StereoPair
from gridslam.logs import open_log, write_log

MS = 1_000_000


def image(stamp_ms: int, camera: str, value: int) -> Image:
    return Image(stamp_ms * MS, camera, np.full((2, 3), value, np.uint8), camera)


def pairs(path: Path, events: list[Event]) -> tuple[list[StereoPair], dict[str, int]]:
    write_log(path, events)
    with open_log(path, kinds=["stereo"]) as log:
        found = [e for e in log.events() if isinstance(e, StereoPair)]
        return found, log.counters


@pytest.mark.parametrize("name", ["a.mcap", "a"])
def test_images_of_one_moment_become_pairs_and_lonely_ones_are_counted(tmp_path: Path, name: str) -> None:
    events: list[Event] = [
        image(100, "left", 1),
        image(103, "right", 2),
        image(200, "left", 3),
        image(300, "left", 4),
        image(300, "right", 5),
        image(400, "right", 6),
    ]
    found, counters = pairs(tmp_path / name, events)
    assert [(p.stamp_ns // MS, int(p.left[0, 0]), int(p.right[0, 0])) for p in found] == [
        (100, 1, 2),
        (300, 4, 5),
    ]
    assert counters["skipped.stereo.no_partner"] == 2
    assert counters["read.stereo"] == 2


def test_colour_becomes_grey_by_the_weights_of_bt601(tmp_path: Path) -> None:
    red = np.zeros((1, 1, 3), np.uint8)
    red[..., 0] = 200
    left = Image(MS, "left", red, "left")
    found, _ = pairs(tmp_path / "a.mcap", [left, Image(MS, "right", red, "right")])
    assert int(found[0].left[0, 0]) == round(0.299 * 200)


def test_a_written_pair_reads_back(tmp_path: Path) -> None:
    pair = StereoPair(5 * MS, "head", np.arange(6, dtype=np.uint8).reshape(2, 3), np.ones((2, 3), np.uint8))
    for name in ("a.mcap", "a"):
        found, _ = pairs(tmp_path / name, [pair])
        assert (found[0].stamp_ns, found[0].frame_id) == (pair.stamp_ns, "head")
        np.testing.assert_array_equal(found[0].left, pair.left)
        np.testing.assert_array_equal(found[0].right, pair.right)
