"""The files that a simulation writes."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Imu, LaserScan, Odometry
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.logs import open_log, write_log
from gridslam.logs.tum import read_trajectory
from gridslam.logs.write import open_writer
from gridslam.maps.map_server import load_map
from gridslam.report import world_picture
from gridslam.report.world_picture import draw_world
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import load_world, validate_world
from tests.conftest import Program

SMALL = """
version: 1
seed: 5
walls: [{rectangle: [0, 0, 6, 4]}]
doors: [{id: d, hinge: [2, 4], width_m: 0.9, openings_deg: {1: -80}, tag: {id: tag-d, position: [0.45, -0.02], facing_deg: -90}}]
objects: [{id: b, pose: [4, 3.6, -90], size: [0.4, 0.4], moves: {0: [4.5, 3.6, -90]}, tag: {id: tag-b, position: [0.2, 0]}}]
people: [{path: [[1, 3], [5, 3]]}]
robot: {start: [1, 1, 0], route: [[4, 1], [4, 2], [1, 2]], wheels: {slip_deviation: 0.02}}
sensors:
  lidar: {beams: 90}
  gyro: {}
  odometry: {publish_wheels: true}
  antennas: [{name: antenna}]
  absolute_poses: {}
"""


@pytest.fixture
def world_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def digests(folder: Path) -> dict[str, str]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.mark.parametrize("name", ["log.mcap", "log"])
def test_a_log_and_its_truth_are_readable(world_file: Path, tmp_path: Path, name: str) -> None:
    world, path = load_world(str(world_file))
    done = record_world(world, path.parent, tmp_path / name)
    with open_log(tmp_path / name) as log:
        kinds = [type(event).__name__ for event in log.events()]
    assert {"LaserScan", "Odometry", "Imu", "WheelTicks", "TagInventory", "AbsolutePose"} <= set(kinds)
    assert kinds.count("LaserScan") == done.messages["LaserScan"]
    truth = read_trajectory(tmp_path / "log.truth" / "trajectory.tum")
    assert truth.poses[0] == pytest.approx([1, 1, 0])
    assert np.hypot(*(truth.poses[-1, :2] - [1, 2])) < 0.3
    assert load_map(tmp_path / "log.truth" / "map.yaml").probability.shape == (120, 160)
    objects = read_objects(tmp_path / "log.truth" / "objects.csv")
    assert objects["d"].state == "open"
    assert objects["d"].moved
    assert objects["b"].pose[:2] == pytest.approx((4.5, 3.6))
    again, _ = load_world(str(tmp_path / "log.truth" / "world.yaml"))
    assert again == world


def test_the_same_world_and_seed_give_the_same_bytes_on_any_number_of_threads(
    world_file: Path, tmp_path: Path
) -> None:
    found = []
    for threads in ("1", "2"):
        folder = tmp_path / threads
        folder.mkdir()
        command = [sys.executable, "-m", "gridslam.cli.main"]
        code = "import sys; from gridslam.cli.main import main; sys.exit(main(sys.argv[1:]))"
        command = [
            sys.executable,
            "-c",
            code,
            "simulate",
            str(world_file),
            "-o",
            str(folder / "log.mcap"),
            "-q",
        ]
        environment = {**os.environ, "NUMBA_NUM_THREADS": threads}
        subprocess.run(command, check=True, env=environment, capture_output=True)
        found.append(digests(folder))
    assert found[0] == found[1]
    assert set(found[0]) == {
        "log.mcap",
        *(
            f"log.truth/{name}"
            for name in ("map.pgm", "map.yaml", "objects.csv", "tags.yaml", "trajectory.tum", "world.yaml")
        ),
    }


def test_a_standard_reader_opens_the_log(world_file: Path, tmp_path: Path) -> None:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    world, path = load_world(str(world_file))
    done = record_world(world, path.parent, tmp_path / "log.mcap")
    names: dict[str, int] = {}
    with (tmp_path / "log.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, _, _, message in reader.iter_decoded_messages():
            assert schema is not None
            assert message is not None
            names[schema.name] = names.get(schema.name, 0) + 1
    assert names["sensor_msgs/msg/LaserScan"] == done.messages["LaserScan"]
    assert names["gridslam_msgs/msg/TagInventory"] == done.messages["TagInventory"]
    assert names["geometry_msgs/msg/PoseWithCovarianceStamped"] == done.messages["AbsolutePose"]


def test_the_truth_in_the_log_is_not_shown_to_methods(world_file: Path, tmp_path: Path) -> None:
    world, path = load_world(str(world_file))
    done = record_world(world, path.parent, tmp_path / "log.mcap")
    with open_log(tmp_path / "log.mcap") as log:
        events = list(log.events())
    assert sum(isinstance(event, Odometry) for event in events) == done.messages["Odometry"]
    assert sum(isinstance(event, LaserScan) for event in events) == done.messages["LaserScan"]


def test_a_preview_is_a_picture(world_file: Path, tmp_path: Path) -> None:
    world, path = load_world(str(world_file))
    draw_world(world, path.parent, tmp_path / "world.png")
    assert (tmp_path / "world.png").read_bytes().startswith(b"\x89PNG")


def test_a_world_of_too_many_walls_is_not_drawn(
    world_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world, path = load_world(str(world_file))
    monkeypatch.setattr(world_picture, "MAX_SEGMENTS", 3)
    with pytest.raises(ConfigError, match=r"\d+ pieces of walls, at most 3 are drawn"):
        draw_world(world, path.parent, tmp_path / "world.png")
    assert not (tmp_path / "world.png").exists()


def test_the_command_says_what_it_wrote_and_refuses_to_overwrite(
    program: Program, world_file: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    done = program("simulate", world_file, "-o", log, "--json", "--seed", "9")
    assert done.returncode == 0, done.stderr
    assert yaml.safe_load(done.stdout)["messages"]["LaserScan"] > 50
    again = program("simulate", world_file, "-o", log)
    assert again.returncode == 2
    assert "--force" in again.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["office"], "nothing to do"),
        (["nowhere", "-o", "x.mcap"], "neither a world file nor a built-in world"),
        (["office", "-o", "x.mcap", "--set", "robot.speed=3"], "robot.speed: no such key"),
    ],
)
def test_wrong_commands_end_with_two(program: Program, arguments: list[str], message: str) -> None:
    done = program("simulate", *arguments)
    assert done.returncode == 2
    assert message in done.stderr


def recorded(tmp_path: Path, **options: bool) -> Path:
    """A short drive, recorded as log.mcap."""
    world = validate_world({"walls": [{"rectangle": [0, 0, 4, 3]}], "robot": {"start": [1, 1, 0]}}, "tiny")
    record_world(world, tmp_path, tmp_path / "log.mcap", **options)
    return tmp_path / "log.mcap"


def test_a_log_and_its_truth_are_replaced_together_and_only_with_force(tmp_path: Path) -> None:
    log = recorded(tmp_path)
    assert not list((tmp_path / "log.truth").glob(".*"))
    (tmp_path / "log.truth" / "tags.yaml").write_text("of an earlier world")
    log.unlink()
    with pytest.raises(ConfigError, match=r"log\.truth: exists; choose another name or use --force"):
        recorded(tmp_path)
    recorded(tmp_path, force=True)
    assert log.exists()
    assert not (tmp_path / "log.truth" / "tags.yaml").exists()


def test_a_folder_that_is_no_truth_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "log.truth").mkdir()
    (tmp_path / "log.truth" / "notes.txt").touch()
    with pytest.raises(ConfigError, match="is not ground truth, so it is never replaced"):
        recorded(tmp_path, force=True)
    assert not (tmp_path / "log.mcap").exists()


def test_a_truth_whose_log_was_not_finished_is_replaced_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("gridslam.logs.mcap.writer.put_file", killed)
        patch.setattr("gridslam.simulation.record.remove", lambda path: None)  # as nothing does after a kill
        with pytest.raises(KeyboardInterrupt):
            recorded(tmp_path)
    assert (tmp_path / "log.truth").exists()
    assert not (tmp_path / "log.mcap").exists()
    assert recorded(tmp_path).exists()


@pytest.mark.parametrize("name", ["out.mcap", "out"])
@pytest.mark.parametrize("force", [False, True])
def test_of_two_writers_of_one_log_the_second_is_reported(tmp_path: Path, name: str, force: bool) -> None:
    if force:
        write_log(tmp_path / name, [])
    first, second = open_writer(tmp_path / name, force), open_writer(tmp_path / name, force)
    first.close()
    with pytest.raises(ConfigError, match=r"another process has written it meanwhile|exists already"), second:
        second.write(Imu(10**9, "imu", 0.5))
    with open_log(tmp_path / name) as log:
        assert not list(log.events())
