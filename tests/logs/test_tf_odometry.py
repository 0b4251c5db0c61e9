"""Odometry of logs that have it in /tf alone."""

from __future__ import annotations

from array import array

import pytest

from gridslam.core.errors import ConfigError
from gridslam.logs.config import LogConfig
from gridslam.logs.selection import select_streams
from gridslam.logs.streams import RecordedStream


def tf(parent: str, child: str) -> RecordedStream:
    stamps = array("q", [0, 1])
    return RecordedStream(
        "tf", "/tf", "tf2_msgs/msg/TFMessage", f"{parent}->{child}", stamps, {parent: None}, child
    )


@pytest.mark.parametrize(
    "children",
    [["base_link"], ["base_footprint"], ["base_footprint", "base_link"], ["base_link", "base_footprint"]],
)
def test_of_two_frames_of_one_robot_base_link_is_taken(children: list[str]) -> None:
    selection = select_streams([tf("odom", child) for child in children], LogConfig(), {"odom"}, None)
    assert selection.base_frame == ("base_link" if "base_link" in children else children[0])
    assert list(selection.kind_of.values()) == ["odom"]


def test_of_two_robots_one_must_be_chosen() -> None:
    streams = [tf("odom", "robot1/base_link"), tf("odom", "robot2/base_link")]
    with pytest.raises(ConfigError, match="Choose one in the config"):
        select_streams(streams, LogConfig(), {"odom"}, None)
