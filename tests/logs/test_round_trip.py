"""What is written as MCAP or CSV reads back as the same events, to the last bit."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Event,
    Image,
    Imu,
    LaserScan,
    Odometry,
    Range,
    TagInventory,
    Transform,
    WheelTicks,
    canonical_yaw,
)
from gridslam.logs import open_log, write_log
from gridslam.logs.mcap.writer import McapWriter
from tests.logs.mutations import fingerprint, sample_events

NO_SHRINKING = (Phase.explicit, Phase.reuse, Phase.generate)
stamps = st.integers(0, 2**31 * 10**9 - 1)
number = st.floats(allow_nan=False, allow_infinity=False, width=64)
metres = st.floats(-1e9, 1e9)
angle = st.floats(-math.pi, math.pi).map(canonical_yaw)
single = st.floats(width=32, allow_nan=False, allow_infinity=False)
positive = st.floats(0.0009765625, 1000.0, width=32)
text = st.text(
    st.characters(codec="utf-8", exclude_characters="\0\r\n\x85\u2028\u2029", exclude_categories=["Cs"])
)
name = text.map(str.strip).filter(lambda t: bool(t) and not t.startswith("/"))
reading = st.one_of(positive, st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0]))


def array(dtype: type, *shape: int) -> st.SearchStrategy[np.ndarray]:
    return st.integers(0, 2**32 - 1).map(lambda seed: _random(dtype, shape, seed))


def _random(dtype: type, shape: tuple[int, ...], seed: int) -> np.ndarray:
    random_numbers = np.random.default_rng(seed)
    if dtype is np.uint8:
        return random_numbers.integers(0, 256, shape).astype(np.uint8)
    values = random_numbers.normal(size=shape).astype(dtype)
    if dtype is np.float32:
        values = np.abs(values)
        values[0, 0] = np.nan
    return values


scans = st.builds(
    LaserScan,
    stamps,
    st.just("laser"),
    st.lists(reading, min_size=1, max_size=9).map(lambda r: np.array(r, np.float32)),
    st.floats(-3.125, 3.125, width=32),
    st.sampled_from([0.0078125, -0.0078125]),
    st.just(0.0),
    positive,
    st.floats(0.0, 1.0, width=32),
)
odometry = st.builds(
    Odometry,
    stamps,
    st.just("odom"),
    number,
    number,
    angle,
    st.one_of(number, st.just(math.nan)),
    st.one_of(number, st.just(math.nan)),
    st.just("base_link"),
)
others = {
    "imu": st.builds(
        Imu,
        stamps,
        st.just("imu_link"),
        number,
        number,
        number,
        st.one_of(st.none(), st.tuples(*4 * [number]).filter(any)),
        st.one_of(st.none(), st.tuples(*3 * [number]).filter(any)),
    ),
    "wheels": st.builds(WheelTicks, stamps, st.just("base_link"), number, number),
    "range": st.builds(Range, stamps, name, angle, reading, st.just(0.0), positive),
    "tags": st.integers(0, 4).flatmap(
        lambda n: st.builds(
            TagInventory,
            stamps,
            name,
            name,
            st.lists(name, min_size=n, max_size=n).map(tuple),
            st.lists(single, min_size=n, max_size=n).map(tuple),
        )
    ),
    "pose": st.builds(
        AbsolutePose,
        stamps,
        st.just("map"),
        st.tuples(number, number, angle).map(lambda p: np.array(p)),
        array(np.float64, 3, 3).map(lambda a: a @ a.T + np.eye(3)).map(lambda a: (a + a.T) / 2),
    ),
    "image": st.builds(Image, stamps, name, array(np.uint8, 4, 5, 3), st.just("head")),
    "grey": st.builds(Image, stamps, name, array(np.uint8, 4, 5), st.just("head")),
    "depth": st.builds(DepthImage, stamps, name, array(np.float32, 3, 4), st.just("head")),
    "disparity": st.builds(
        Disparity, stamps, name, array(np.float32, 3, 4), positive, positive, st.just("head")
    ),
    "camera_info": st.builds(
        CameraInfo,
        stamps,
        name,
        st.integers(1, 9999),
        st.integers(1, 9999),
        array(np.float64, 3, 3),
        array(np.float64, 3, 4),
        st.sampled_from([0, 4, 5, 8, 14, 15, 20]).map(lambda n: np.arange(1.0, n + 1.0)),
        st.just("head"),
    ),
    "tf": st.builds(
        Transform,
        stamps,
        st.just("odom"),
        st.just("wheel"),
        st.tuples(metres, metres, metres),
        angle.map(lambda yaw: (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))),
    ),
}


def read_back(events: list[Event], suffix: str) -> tuple[list[Event], dict[str, int]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        write_log(path, events)
        with open_log(path) as log:
            return [e for e in log.events() if not (isinstance(e, Transform) and e.is_static)], log.counters


def in_order(events: list[Event]) -> list[Event]:
    return sorted(events, key=lambda e: e.stamp_ns)


@pytest.mark.parametrize("suffix", [".mcap", ""])
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow], phases=NO_SHRINKING)
@given(st.lists(scans, max_size=5, unique_by=lambda e: e.stamp_ns), st.lists(odometry, max_size=5))
def test_scans_and_odometry_read_back_equal(
    suffix: str, scan_list: list[Event], odometry_list: list[Event]
) -> None:
    events = in_order([*odometry_list, *scan_list])
    back, counters = read_back(events, suffix)
    outliers = sum(n for key, n in counters.items() if key.endswith("outlier_stamp"))
    assert len(back) + outliers == len(events)
    if not outliers:
        assert list(map(fingerprint, back)) == list(map(fingerprint, events))


@pytest.mark.parametrize("suffix", [".mcap", ""])
@pytest.mark.parametrize("kind", others)
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow], phases=NO_SHRINKING)
@given(data=st.data())
def test_every_kind_reads_back_equal(suffix: str, kind: str, data: st.DataObject) -> None:
    events = in_order(data.draw(st.lists(others[kind], max_size=2, unique_by=lambda e: e.stamp_ns)))
    back, _ = read_back(events, suffix)
    assert list(map(fingerprint, back)) == list(map(fingerprint, events))


@pytest.mark.parametrize("name", ["log.mcap", "log"])
def test_the_same_events_give_the_same_bytes(tmp_path: Path, name: str) -> None:
    contents = []
    for run in ("a", "b"):
        (tmp_path / run).mkdir()
        path = tmp_path / run / name
        write_log(path, sample_events(10, 5))
        files = [path] if path.is_file() else sorted(path.iterdir())
        contents.append([(file.name, file.read_bytes()) for file in files])
    assert contents[0] == contents[1]


@pytest.mark.parametrize("name", ["log.mcap", "log"])
def test_an_interrupted_writer_leaves_nothing_behind(tmp_path: Path, name: str) -> None:
    def events():  # type: ignore[no-untyped-def]
        yield from sample_events(2, 3)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_log(tmp_path / name, events())
    assert not list(tmp_path.iterdir())


def test_a_standard_reader_understands_our_mcap(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    odometry_event = Odometry(1_500_000_001, "odom", 1.5, -2.5, 0.5, 0.25, 0.125)
    scan = LaserScan(1_600_000_002, "laser", np.array([1.5, np.inf, 3.25], np.float32), -1.0, 0.5, 0.125, 8.0)
    tags = TagInventory(1_700_000_003, "antenna", "left", ("e2-01", "e2-02"), (-40.5, -61.0))
    info = CameraInfo(
        1_800_000_004,
        "cam",
        640,
        480,
        np.eye(3) * 2,
        np.ones((3, 4)),
        np.array([0.1, 0.2, 0, 0, 0.3]),
        "head",
    )
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    events: list[Event] = [
        Transform(1_000_000_000, "base_link", "laser", (0.1, 0.2, 0.3), (0.5, 0.5, -0.5, 0.5), True),
        odometry_event,
        scan,
        tags,
        info,
        Image(1_900_000_005, "cam", pixels, "head"),
        Range(2_000_000_006, "ir_left", 0.25, 0.5, 0.125, 1.5),
        WheelTicks(2_100_000_007, "base_link", 1.25, -1.5),
        Imu(2_200_000_008, "imu", 0.75),
        AbsolutePose(2_300_000_009, "map", np.array([1.0, 2.0, 0.5]), np.diag([0.1, 0.2, 0.3])),
        Disparity(2_400_000_010, "cam", np.full((2, 3), 7.5, np.float32), 500.0, 0.25, "head"),
        DepthImage(2_500_000_011, "cam", np.full((2, 3), 1.5, np.float32), "head"),
    ]
    with McapWriter(path) as writer:
        for event in events:
            writer.write(event)
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    scan_message = found["/scan"]
    assert (scan_message.header.stamp.sec, scan_message.header.stamp.nanosec) == (1, 600_000_002)
    assert scan_message.header.frame_id == "laser"
    assert list(scan_message.ranges) == [1.5, math.inf, 3.25]
    assert (scan_message.angle_min, scan_message.angle_max, scan_message.angle_increment) == (-1.0, 0.0, 0.5)
    assert (scan_message.range_min, scan_message.range_max) == (0.125, 8.0)
    pose = found["/odom"].pose.pose
    assert (pose.position.x, pose.position.y) == (1.5, -2.5)
    assert 2 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5, abs=1e-12)
    assert found["/odom"].twist.twist.angular.z == 0.125
    assert found["/odom"].child_frame_id == "base_link"
    transform = found["/tf_static"].transforms[0]
    assert (transform.child_frame_id, transform.transform.rotation.y) == ("laser", -0.5)
    assert list(found["/tags"].tag_ids) == ["e2-01", "e2-02"]
    assert list(found["/tags"].rssi_dbm) == [-40.5, -61.0]
    camera = found["/head/camera_info"]
    assert (camera.width, camera.height, list(camera.d)) == (640, 480, [0.1, 0.2, 0, 0, 0.3])
    assert list(camera.k) == [2, 0, 0, 0, 2, 0, 0, 0, 2]
    assert bytes(found["/head/image"].data) == pixels.tobytes()
    assert (found["/head/image"].encoding, found["/head/image"].step) == ("rgb8", 12)
    assert (found["/range"].range, found["/range"].max_range) == (0.5, 1.5)
    assert (list(found["/range/servo"].name), list(found["/range/servo"].position)) == (["ir_left"], [0.25])
    assert list(found["/joint_states"].position) == [1.25, -1.5]
    assert found["/imu"].angular_velocity.z == 0.75
    covariance = found["/pose"].pose.covariance
    assert (covariance[0], covariance[7], covariance[35]) == (0.1, 0.2, 0.3)
    assert (found["/head/disparity"].f, found["/head/disparity"].t) == (500.0, 0.25)
    assert np.frombuffer(bytes(found["/head/depth"].data), "<f4").tolist() == [1.5] * 6
