"""Two writers of one log at the same time: the first to finish is kept, the other gets an error."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Odometry
from gridslam.logs import open_log, open_writer

KINDS = {"mcap": ("log.mcap", False), "csv": ("log", False), "rosbag2": ("bag", True)}


def odometry(x_m: float) -> Odometry:
    return Odometry(10**9, "odom", x_m=x_m, y_m=0.0, yaw_rad=0.0)


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_the_first_to_finish_is_kept_and_the_other_is_reported(
    tmp_path: Path, kind: str, force: bool
) -> None:
    name, as_rosbag2 = KINDS[kind]
    path = tmp_path / name
    if force:
        with open_writer(path, as_rosbag2=as_rosbag2) as writer:
            writer.write(odometry(0.0))
    first = open_writer(path, force, as_rosbag2=as_rosbag2)
    second = open_writer(path, force, as_rosbag2=as_rosbag2)
    second.write(odometry(2.0))
    first.write(odometry(1.0))
    second.close()
    with pytest.raises(ConfigError, match=r"another process has written it meanwhile|exists already"):
        first.close()
    with open_log(path) as log:
        assert [event.x_m for event in log.events() if isinstance(event, Odometry)] == [2.0]
    assert [entry.name for entry in tmp_path.iterdir()] == [name], "nothing is left beside it"
