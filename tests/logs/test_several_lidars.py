"""Logs with several lidars or IMUs: what is used together, what is refused, and that the advice works."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Imu, LaserScan
from gridslam.logs import LogConfig, open_log
from tests.logs.ros_samples import header, make, odometry, scan, tf, transform, write_mcap

S = 10**9
KINDS = ["scan", "odom", "imu"]
PLACES = {"front": (0.3, 0.0, 0.2), "rear": (-0.3, 0.0, 0.2)}


def two_lidars(path: Path, places: dict[str, tuple[float, float, float]] = PLACES) -> Path:
    """Scans of /front at 1 Hz and of /rear at 2 Hz."""
    static = tf(*(transform(0, "base_link", frame, xyz) for frame, xyz in places.items()))
    messages = [("/tf_static", static), *(("/odom", odometry(i * S)) for i in range(5))]
    messages += [("/front", scan(i * S, frame="front")) for i in range(1, 5)]
    messages += [("/rear", scan(i * S // 2, frame="rear")) for i in range(1, 9)]
    return write_mcap(path, messages)


def frames(path: Path, config: LogConfig | None = None) -> list[str]:
    with open_log(path, config, KINDS) as log:
        return [e.frame_id for e in log.events() if isinstance(e, LaserScan)]


def test_the_scans_of_all_lidars_of_the_robot_are_used(tmp_path: Path) -> None:
    path = two_lidars(tmp_path / "a.mcap")
    assert sorted(frames(path)) == ["front"] * 4 + ["rear"] * 8
    with open_log(path, kinds=KINDS) as log:
        assert {e.child_frame_id: e.translation_m for e in log.sensor_extrinsics} == PLACES
        assert any("2 lidars are used together: /front, /rear" in line for line in log.problems)


@pytest.mark.parametrize(
    ("named", "expected"), [("/rear", {"rear"}), (["/front", "/rear"], {"front", "rear"})]
)
def test_a_line_of_the_config_leaves_one_out(
    tmp_path: Path, named: str | list[str], expected: set[str]
) -> None:
    config = LogConfig.model_validate({"topics": {"scan": named}})
    assert set(frames(two_lidars(tmp_path / "a.mcap"), config)) == expected


def test_a_lidar_without_a_place_on_the_robot_is_refused_and_both_advices_work(tmp_path: Path) -> None:
    path = two_lidars(tmp_path / "a.mcap", {"front": PLACES["front"]})
    with pytest.raises(ConfigError, match=r"log\.extrinsics\.rear: .*\{scan: \[/front\]\}"):
        open_log(path, kinds=KINDS)
    for section in ({"topics": {"scan": ["/front"]}}, {"extrinsics": {"rear": {"x": -0.3}}}):
        assert frames(path, LogConfig.model_validate(section))


def test_two_streams_of_one_lidar_need_a_choice(tmp_path: Path) -> None:
    messages = [(topic, scan(i * S)) for i in range(3) for topic in ("/scan", "/scan_filtered")]
    with pytest.raises(ConfigError, match=r"2 scan streams: /scan .*, /scan_filtered"):
        open_log(write_mcap(tmp_path / "a.mcap", messages), kinds=KINDS)


def test_of_two_imus_that_with_more_messages_is_used(tmp_path: Path) -> None:
    def reading(stamp_ns: int, frame: str) -> object:
        return make("sensor_msgs/msg/Imu", header=header(stamp_ns, frame))

    messages = [("/camera/imu", reading(i * S, "camera_imu")) for i in range(3)]
    messages += [("/imu", reading(i * S // 2, "imu")) for i in range(6)]
    with open_log(write_mcap(tmp_path / "a.mcap", messages), kinds=KINDS) as log:
        assert {e.frame_id for e in log.events() if isinstance(e, Imu)} == {"imu"}
        assert any("/imu is used; log.topics.imu names another" in line for line in log.problems)
