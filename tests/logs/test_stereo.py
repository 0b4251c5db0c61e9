from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pillow

from gridslam.core.cameras import side_of
from gridslam.core.messages import Event, Image, StereoPair
from gridslam.logs import LogConfig, open_log, write_log
from tests.logs.ros_samples import header, make, write_mcap

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


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("/stereo/left/image_rect", "/stereo/right/image_rect"),
        ("/camera/camera/infra1/image_rect_raw", "/camera/camera/infra2/image_rect_raw"),
        ("/cam0/image_raw", "/cam1/image_raw"),
    ],
)
def test_sides_are_known_by_the_names_that_drivers_use(left: str, right: str) -> None:
    assert side_of((left, "")) == "left"
    assert side_of((right, "")) == "right"
    assert side_of(("/camera/color/image_raw", "camera_1")) == ""


def test_rectified_pictures_are_taken_where_raw_ones_lie_beside_them(tmp_path: Path) -> None:
    def picture(stamp_ms: int, value: int) -> Any:
        pixels = np.full(6, value, np.uint8)
        head = header(stamp_ms * MS, "optical")
        return make(
            "sensor_msgs/msg/Image", header=head, encoding="mono8", height=2, width=3, step=3, data=pixels
        )

    names = [f"/stereo/{side}/{kind}" for side in ("left", "right") for kind in ("image_raw", "image_rect")]
    messages = [(name, picture(100, 10 * k)) for k, name in enumerate(names)]
    for chosen, values, raw in ((messages, (10, 30), False), (messages[::2], (0, 20), True)):
        with open_log(write_mcap(tmp_path / "a.mcap", chosen), kinds=["stereo"]) as log:
            (pair,) = [e for e in log.events() if isinstance(e, StereoPair)]
        assert (int(pair.left[0, 0]), int(pair.right[0, 0])) == values
        assert pair.is_raw is raw


def test_named_streams_are_taken_and_compressed_copies_are_not(tmp_path: Path) -> None:
    png = io.BytesIO()
    Pillow.fromarray(np.full((2, 3), 90, np.uint8)).save(png, format="PNG")
    messages = []
    for k, side in enumerate(("left", "right")):
        pixels = np.full(6, 10 * k, np.uint8)
        head = header(100 * MS, "optical")
        plain = make(
            "sensor_msgs/msg/Image", header=head, encoding="mono8", height=2, width=3, step=3, data=pixels
        )
        packed = np.frombuffer(png.getvalue(), np.uint8)
        copy = make(
            "sensor_msgs/msg/CompressedImage", header=head, format="mono8; png compressed", data=packed
        )
        messages += [(f"/{side}/image_raw", plain), (f"/{side}/image_raw/compressed", copy)]
    path = write_mcap(tmp_path / "a.mcap", messages)
    topics = {"stereo": ["/left/image_raw/compressed", "/right/image_raw/compressed"]}
    for config, values in ((LogConfig(), (0, 10)), (LogConfig.model_validate({"topics": topics}), (90, 90))):
        with open_log(path, config, kinds=["stereo"]) as log:
            (pair,) = [e for e in log.events() if isinstance(e, StereoPair)]
            assert log.problems == [] or all("extrinsics" in line for line in log.problems)
        assert (int(pair.left[0, 0]), int(pair.right[0, 0])) == values
