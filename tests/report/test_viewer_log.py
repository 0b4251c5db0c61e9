"""result.mcap, read by other people's readers."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan
from gridslam.core.poses import yaw_of_quaternion
from gridslam.logs.open import open_log
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods import registry
from gridslam.methods.base import Estimate, PlacedObject, RunResult
from gridslam.methods.particle_history import ParticleHistory
from gridslam.report.viewer_log import object_markers
from gridslam.report.viewer_messages import occupancy_grid, pose_array
from gridslam.report.write import write_run
from gridslam.runs.run import Run, run_map
from gridslam.runs.run_config import validate_run_config
from tests import dead_reckoning
from tests.dead_reckoning import register

OBJECTS = (PlacedObject("door-1", np.array([1.0, 2.5, 0.5]), "open", has_moved=True),)


class WithParticles(dead_reckoning.DeadReckoning):
    """Dead reckoning that has particles and objects to show."""

    @property
    def estimate(self) -> Estimate | None:
        if not self.stamps:
            return None
        return Estimate(self.stamps[-1], self.pose, self.pose + np.arange(1200.0)[:, None] * 1e-3)

    def result(self) -> RunResult:
        found = super().result()
        return RunResult(found.trajectory, found.occupancy, objects=OBJECTS)


@pytest.fixture(scope="module")
def run(small_log: Path) -> Run:
    """The small log, mapped with the viewer in mind."""
    with pytest.MonkeyPatch.context() as patch:
        entry = replace(dead_reckoning.ENTRY, needs=("scan|depth", "odom"), uses=("image",))
        patch.setattr(dead_reckoning, "ENTRY", entry)
        patch.setattr(registry, "METHODS", register())
        patch.setattr(dead_reckoning, "DeadReckoning", WithParticles)
        config = validate_run_config(
            {"method": {"name": "dead-reckoning"}, "output": {"viewer": True, "html": False}}, "test"
        )
        return run_map(config, small_log, lambda progress: None, lambda: False)


@pytest.fixture
def written(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Its directory."""
    entry = replace(dead_reckoning.ENTRY, needs=("scan|depth", "odom"), uses=("image",))
    monkeypatch.setattr(dead_reckoning, "ENTRY", entry)
    monkeypatch.setattr(registry, "METHODS", register())
    write_run(run, tmp_path / "out")
    return tmp_path / "out"


def decoded(file: Path) -> dict[str, list[Any]]:
    """Messages by topic, as mcap-ros2-support reads them."""
    messages = defaultdict(list)
    with file.open("rb") as stream:
        for _, channel, message, ros in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            messages[channel.topic].append(SimpleNamespace(stamp_ns=message.log_time, ros=ros))
    return messages


def test_another_reader_finds_all_parts(written: Path, run: Run) -> None:
    counts = {topic: len(found) for topic, found in decoded(written / "result.mcap").items()}
    seconds = (run.result.trajectory.stamps_ns[-1] - run.result.trajectory.stamps_ns[0]) / 1e9
    assert counts.pop("/particles") == pytest.approx(seconds, abs=1)
    assert counts == {
        "/tf_static": 1, "/map": 1, "/path": 1, "/objects": 1, "/tf": 120, "/scan": 60, "/odom": 60, "/ground_truth": 60,
    }  # fmt: skip


def test_it_is_a_log_of_ros_2_in_zstd_chunks_with_the_definitions_of_ros(written: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with (written / "result.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        for schema, _, message in reader.iter_messages():
            assert schema is not None
            assert schema.encoding == "ros2msg"
            assert schema.data.decode() == store.generate_msgdef(schema.name, ros_version=2)[0]
            value = store.deserialize_cdr(message.data, schema.name)
            assert bytes(store.serialize_cdr(value, schema.name)) == message.data


def test_the_map_has_the_cells_of_the_run(written: Path, run: Run) -> None:
    (message,) = decoded(written / "result.mcap")["/map"]
    grid = run.occupancy
    assert grid is not None
    info = message.ros.info
    assert (info.height, info.width) == grid.probability.shape
    assert info.resolution == pytest.approx(grid.geometry.resolution_m)
    assert (info.origin.position.x, info.origin.position.y) == grid.geometry.origin_xy_m
    percent = np.array(message.ros.data, float).reshape(info.height, info.width)
    expected = np.where(np.isnan(grid.probability), -1, np.rint(100 * grid.probability))
    assert np.array_equal(percent, expected)
    assert message.stamp_ns == run.result.trajectory.stamps_ns[0]


def test_unknown_cells_are_minus_one_and_a_turned_map_is_turned() -> None:
    probability = np.array([[np.nan, 0.0], [0.5, 1.0], [0.25, np.nan]], np.float32)
    grid = OccupancyGrid(probability, GridGeometry(0.1, (1.0, -2.0), 0.3))
    encoded = occupancy_grid("/map", 5_000_000_007, grid)
    value = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(encoded.data, encoded.type)
    assert value.data.tolist() == [-1, 0, 50, 100, 25, -1]
    assert (value.header.stamp.sec, value.header.stamp.nanosec) == (5, 7)
    turned = value.info.origin.orientation
    assert yaw_of_quaternion(np.array([[turned.w, turned.x, turned.y, turned.z]]))[0] == pytest.approx(0.3)


def test_scans_lie_where_the_trajectory_has_them(written: Path, run: Run, small_log: Path) -> None:
    """scan frame -> base -> odom -> map is connected, and at each scan's stamp odom -> base and map -> odom give map -> base."""
    found = decoded(written / "result.mcap")
    links: dict[str, dict[int, Any]] = defaultdict(dict)
    for message in found["/tf"]:
        (transform,) = message.ros.transforms
        links[transform.header.frame_id][message.stamp_ns] = transform
    assert set(links) == {"map", "odom"}
    (static,) = found["/tf_static"][0].ros.transforms
    assert {t.child_frame_id for t in links["map"].values()} == {"odom"}
    assert {t.child_frame_id for t in links["odom"].values()} == {static.header.frame_id}
    assert {m.ros.header.frame_id for m in found["/scan"]} == {static.child_frame_id}
    trajectory = run.result.trajectory
    for stamp, pose in zip(trajectory.stamps_ns.tolist(), trajectory.poses, strict=True):
        at = se2.compose(planar(links["map"][stamp]), planar(links["odom"][stamp]))
        assert at == pytest.approx(pose, abs=1e-9)
    assert {m.stamp_ns for m in found["/scan"]} <= set(links["map"])
    with open_log(small_log) as log:
        scans = [event for event in log.events() if isinstance(event, LaserScan)]
    for scan, message in zip(scans, found["/scan"], strict=True):
        assert np.array_equal(np.array(message.ros.ranges, np.float32), scan.ranges_m, equal_nan=True)


def planar(transform: Any) -> np.ndarray:
    at, q = transform.transform.translation, transform.transform.rotation
    return np.array([at.x, at.y, yaw_of_quaternion(np.array([[q.w, q.x, q.y, q.z]]))[0]])


def test_it_can_be_mapped_again(written: Path, run: Run) -> None:
    again = run_map(run.config, written / "result.mcap", lambda progress: None, lambda: False)
    assert np.array_equal(again.result.trajectory.stamps_ns, run.result.trajectory.stamps_ns)
    assert np.array_equal(again.result.trajectory.poses, run.result.trajectory.poses)
    assert again.truth is not None


def test_particles_are_few_and_in_the_map_frame(written: Path) -> None:
    for message in decoded(written / "result.mcap")["/particles"]:
        assert message.ros.header.frame_id == "map"
        assert 1 <= len(message.ros.poses) <= 500


def test_objects_are_cubes_with_names() -> None:
    encoded = object_markers(OBJECTS, 10**9)
    value = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(encoded.data, encoded.type)
    cube, name = value.markers
    assert (cube.type, name.type) == (cube.CUBE, name.TEXT_VIEW_FACING)
    assert (cube.pose.position.x, cube.pose.position.y) == (1.0, 2.5)
    assert cube.pose.orientation.z == pytest.approx(np.sin(0.25))
    assert name.text == "door-1 open"


def test_any_poses_make_a_pose_array(rng: np.random.Generator) -> None:
    poses = rng.normal(size=(7, 3))
    encoded = pose_array("/particles", 3, poses)
    value = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(encoded.data, encoded.type)
    for pose, found in zip(poses, value.poses, strict=True):
        assert (found.position.x, found.position.y) == tuple(pose[:2])
        assert [found.orientation.w, found.orientation.z] == pytest.approx(
            [np.cos(pose[2] / 2), np.sin(pose[2] / 2)]
        )


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_the_same_run_has_the_same_bytes(
    run: Run, written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(run, tmp_path / "again")
    assert (tmp_path / "again" / "result.mcap").read_bytes() == (written / "result.mcap").read_bytes()


def test_without_being_asked_for_it_is_not_written(finished_run: Run, tmp_path: Path) -> None:
    write_run(finished_run, tmp_path / "out")
    assert not (tmp_path / "out" / "result.mcap").exists()


def test_the_history_of_a_long_log_is_thinned() -> None:
    """1000 s at 10 Hz with at most 50 snapshots: every 32 s is the first power of two that does with 50."""

    class Still:
        stamp_ns = 0

        @property
        def estimate(self) -> Estimate:
            return Estimate(self.stamp_ns, np.zeros(3), np.zeros((30, 3)))

        def process(self, event: Event) -> None:
            self.stamp_ns = event.stamp_ns

        def result(self) -> RunResult:
            raise AssertionError

    history = ParticleHistory(Still(), max_snapshots=50, max_particles=7)
    empty = np.zeros(0, np.float32)
    for k in range(10_000):
        history.process(LaserScan(k * 100_000_000, "laser", empty, 0.0, 0.1, 0.1, 10.0))
    stamps = [s.stamp_ns for s in history.snapshots]
    gaps = Counter(np.diff(stamps).tolist())
    assert gaps == {32 * 10**9: len(stamps) - 1}
    assert 25 <= len(stamps) <= 50
    assert {len(s.particles) for s in history.snapshots} == {6}
