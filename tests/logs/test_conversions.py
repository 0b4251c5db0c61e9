"""A log keeps every event in any chain of conversions, or the conversion says aloud that it cannot."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gridslam.core.errors import LogError
from gridslam.core.messages import (
    CameraInfo,
    Event,
    Image,
    Imu,
    LaserScan,
    Odometry,
    PointCloud,
    Range,
    TagInventory,
    Transform,
    WheelTicks,
)
from gridslam.logs import open_log, open_writer
from gridslam.logs.convert import convert_log
from gridslam.logs.kinds import TRUTH_TOPIC
from tests.logs.mutations import fingerprint
from tests.logs.test_round_trip import NO_SHRINKING, angle, name, number, others, positive, reading, single

S = 10**9
frame = st.one_of(st.just(""), name, name)
scan = st.builds(
    LaserScan,
    st.just(0),
    frame,
    st.lists(reading, min_size=1, max_size=5).map(lambda r: np.array(r, np.float32)),
    st.floats(-3.125, 3.125, width=32),
    st.sampled_from([0.0078125, -0.0078125]),
    st.just(0.0),
    positive,
)
odometry = st.builds(Odometry, st.just(0), frame, number, number, angle, number, number, name)
tags = st.integers(0, 3).flatmap(
    lambda n: st.builds(
        TagInventory,
        st.just(0),
        frame,
        name,
        st.lists(name, min_size=n, max_size=n).map(tuple),
        st.lists(single, min_size=n, max_size=n).map(tuple),
    )
)
streams: dict[str | None, st.SearchStrategy[Event]] = {
    "/scan": scan,
    "/rear/scan": scan,
    "/odom": odometry,
    TRUTH_TOPIC: odometry,
    "/imu": st.builds(Imu, st.just(0), frame, number),
    "/wheels": st.builds(WheelTicks, st.just(0), frame, number, number),
    "/ir": st.builds(Range, st.just(0), frame, angle, reading, st.just(0.0), positive),
    "/tags": tags,
    "/pose": others["pose"],
    "/head/camera_info": others["camera_info"],
    "/head/image": others["image"],
    "/head/depth": others["depth"],
    "/head/disparity": others["disparity"],
    "/tf": others["tf"],
}


@st.composite
def logs(draw: st.DrawFn) -> list[tuple[str | None, Event]]:
    """Events with their topics: a few streams of all kinds, stamps unique and sometimes out of order."""
    stamps = draw(st.lists(st.integers(S, 20 * S), min_size=1, max_size=12, unique=True))
    found = []
    for stamp in stamps:
        topic = draw(st.sampled_from(list(streams)))
        event = draw(streams[topic])
        object.__setattr__(event, "stamp_ns", stamp)
        found.append((topic, event))
    return found


def events_of(path: Path) -> tuple[list[bytes], bool]:
    with open_log(path) as log:
        return [fingerprint(e) for _, _, e in log.events_by_stream(with_truth=True)], log.is_lossy


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck), phases=NO_SHRINKING)
@given(logs(), st.lists(st.sampled_from([".mcap", ""]), min_size=2, max_size=4))
def test_every_chain_of_conversions_keeps_every_event(
    log: list[tuple[str | None, Event]], suffixes: list[str]
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "first.mcap"
        with open_writer(path) as writer:
            for topic, event in log:
                writer.write(event, topic)
        expected, is_lossy = events_of(path)
        assert not is_lossy
        assert len(expected) >= len(log)
        for number_, suffix in enumerate(suffixes):
            converted = Path(folder) / f"log{number_}{suffix}"
            with open_log(path) as opened:
                convert_log(opened, converted)
            assert events_of(converted) == (expected, False)
            path = converted


def test_a_topic_named_as_the_truth_that_holds_other_messages_is_no_truth(tmp_path: Path) -> None:
    events = [
        Imu(S, "imu", 1.0),
        Odometry(S, "odom", 1.0, 2.0, 0.5),
        Transform(S, "a", "b", (0, 0, 0), (1, 0, 0, 0)),
    ]
    for suffix in ("", ".mcap"):
        path = tmp_path / f"log{suffix}"
        with open_writer(path) as writer:
            for event in events:
                writer.write(event, TRUTH_TOPIC)
        with open_log(path) as log:
            convert_log(log, tmp_path / f"again{suffix}")
            kinds = {info.kind for info in log.streams}
        assert kinds == {"imu", "truth", "tf"}
        assert events_of(tmp_path / f"again{suffix}") == events_of(path)


@pytest.mark.parametrize("suffix", ["", ".mcap"])
def test_an_event_without_a_frame_remains_without_one_and_keeps_its_extrinsics(
    tmp_path: Path, suffix: str
) -> None:
    placed_sensors = Transform(S, "base_link", "", (0.25, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True)
    scan_ = LaserScan(2 * S, "", np.ones(3, np.float32), -1.0, 0.5, 0.125, 30.0)
    with open_writer(tmp_path / "first.mcap") as writer:
        for event in (placed_sensors, Odometry(S, "odom", 0.0, 0.0, 0.0), scan_):
            writer.write(event)
    with open_log(tmp_path / "first.mcap") as log:
        convert_log(log, tmp_path / f"log{suffix}")
    with open_log(tmp_path / f"log{suffix}") as log:
        static, _, back = log.events()
    assert (static.child_frame_id, static.translation_m) == ("", (0.25, 0.0, 0.0))
    assert back.frame_id == ""


@pytest.mark.parametrize("size", [(0, 480), (640, -1), (1 << 32, 480)])
def test_a_calibration_of_an_impossible_size_is_left_out_and_counted(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    good = CameraInfo(S, "cam", 640, 480, np.eye(3), np.eye(3, 4), np.zeros(5), "head")
    folder = tmp_path / "log"
    with open_writer(folder) as writer:
        writer.write(good)
        writer.write(CameraInfo(2 * S, "cam", *size, np.eye(3), np.eye(3, 4), np.zeros(5), "head"))
    with open_log(folder) as log:
        convert_log(log, tmp_path / "log.mcap")
        assert log.counters["skipped.camera_info.bad_image_size"] == 1
    with open_log(tmp_path / "log.mcap") as log:
        assert [e.width_px for e in log.events() if isinstance(e, CameraInfo)] == [640]


def test_a_calibration_that_is_not_finite_is_left_out_and_counted_in_every_format(tmp_path: Path) -> None:
    bad = np.eye(3, 4)
    bad[1, 1] = np.nan
    with open_writer(tmp_path / "log.mcap") as writer:
        writer.write(CameraInfo(S, "cam", 640, 480, np.eye(3), bad, np.zeros(5), "head"))
    with open_log(tmp_path / "log.mcap") as log:
        assert not [e for e in log.events() if isinstance(e, CameraInfo)]
        assert log.counters["skipped.camera_info.not_finite"] == 1


def test_an_inventory_with_tags_and_strengths_that_do_not_match_is_left_out_and_counted(
    tmp_path: Path,
) -> None:
    with open_writer(tmp_path / "log.mcap") as writer:
        writer.write(TagInventory(S, "ant", "left", ("a", "b"), (-40.0,)))
    with open_log(tmp_path / "log.mcap") as log:
        convert_log(log, tmp_path / "log")
        assert log.counters["skipped.tags.tags_and_rssi_differ"] == 1


def test_the_camera_of_a_picture_survives_a_topic_that_names_another(tmp_path: Path) -> None:
    with open_writer(tmp_path / "log") as writer:
        writer.write(Image(S, "cam", np.zeros((2, 2), np.uint8), "left"), "/elsewhere/image")
    with open_log(tmp_path / "log") as log:
        convert_log(log, tmp_path / "log.mcap")
    with open_log(tmp_path / "log.mcap") as log:
        assert [e.camera for e in log.events() if isinstance(e, Image)] == ["left"]


def test_a_name_that_a_csv_row_cannot_hold_is_refused_aloud(tmp_path: Path) -> None:
    with open_writer(tmp_path / "log.mcap") as writer:
        writer.write(Imu(S, "two\nlines", 0.5))
        writer.write(Imu(2 * S, "imu", 0.5))
    with (
        open_log(tmp_path / "log.mcap") as log,
        pytest.raises(LogError, match=r"'two\\nlines' cannot be written to a CSV file"),
    ):
        convert_log(log, tmp_path / "log")
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize("name", ["a\0b", "half \ud800"])
@pytest.mark.parametrize("place", ["frame", "topic"])
def test_a_name_that_a_format_cannot_hold_is_refused_aloud(tmp_path: Path, name: str, place: str) -> None:
    event = Imu(S, name if place == "frame" else "imu", 0.5)
    topic = f"/{name}" if place == "topic" else None
    # A topic in MCAP may hold a zero
    targets = ["log"] if place == "topic" and "\0" in name else ["log", "log.mcap"]
    for target in targets:
        with pytest.raises(LogError, match="cannot be written"), open_writer(tmp_path / target) as writer:
            writer.write(event, topic)
        assert not (tmp_path / target).exists()


def test_a_row_with_a_zero_in_a_csv_folder_is_left_out_and_counted(tmp_path: Path) -> None:
    with open_writer(tmp_path / "log") as writer:
        for i in range(3):
            writer.write(Imu(i * S, f"imu{i}", 0.5))
    table = tmp_path / "log" / "imu.csv"
    table.write_bytes(table.read_bytes().replace(b"imu1", b"im\0u"))
    with open_log(tmp_path / "log") as log:
        convert_log(log, tmp_path / "log.mcap")
        assert log.counters["skipped.imu.undecodable"] == 1
    assert len(events_of(tmp_path / "log.mcap")[0]) == len(events_of(tmp_path / "log")[0])


def test_a_point_cloud_is_refused_by_a_csv_folder(tmp_path: Path) -> None:
    cloud = PointCloud(S, "lidar", np.ones((2, 3), np.float32), np.zeros(0, np.float32))
    with pytest.raises(LogError, match="has no CSV table"), open_writer(tmp_path / "log") as writer:
        writer.write(cloud)


def test_the_name_of_a_camera_may_be_longer_than_that_of_a_file(tmp_path: Path) -> None:
    camera = "ü" * 300
    with open_writer(tmp_path / "log") as writer:
        writer.write(Image(S, "cam", np.zeros((2, 2), np.uint8), camera))
    with open_log(tmp_path / "log") as log:
        assert [e.camera for e in log.events() if isinstance(e, Image)] == [camera]
