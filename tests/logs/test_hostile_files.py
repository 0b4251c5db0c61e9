"""Files made to contradict themselves, to look changed, or to cost far more than their size."""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import time
import tracemalloc
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from rosbags.typesys import Stores, get_typestore

from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError, InputError, LogError
from gridslam.core.messages import Imu, LaserScan, Odometry, Transform
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.logs import open_log, open_writer
from gridslam.logs.mcap.chunks import CHUNK_HEAD
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.mcap.records import CHANNEL, CHUNK, HEADER, MAGIC, MESSAGE, SCHEMA
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.ros.definitions import BadDefinitionError, checked_types, is_valid
from gridslam.logs.ros.encode import encode
from gridslam.logs.ros.types import ros2_types
from gridslam.logs.tum import read_trajectory
from gridslam.runs.inputs import read_inputs
from tests.conftest import REPOSITORY
from tests.logs.mutations import limit, sample_events
from tests.logs.test_rosbag import rosbag2

S = 10**9
ODOMETRY, SCAN, IMU = "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Imu"


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def schema(number: int, name: str, definition: str | None = None) -> bytes:
    if definition is None:
        definition, _ = ros2_types().generate_msgdef(name, ros_version=2)
    return record(SCHEMA, struct.pack("<H", number) + text(name) + text("ros2msg") + text(definition))


def channel(number: int, schema_number: int, topic: str, encoding: str = "cdr") -> bytes:
    return record(
        CHANNEL, struct.pack("<HH", number, schema_number) + text(topic) + text(encoding) + text("")
    )


def message(number: int, data: bytes) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", number, 0, 0, 0) + data)


def cdr(event: object) -> bytes:
    (encoded,) = encode(event)  # type: ignore[arg-type]
    return encoded.data


def odometry(i: int) -> bytes:
    return cdr(Odometry(i * S, "odom", float(i), 0.0, 0.0))


def mcap(path: Path, *records: bytes) -> Path:
    path.write_bytes(MAGIC + record(HEADER, text("ros2") + text("test")) + b"".join(records))
    return path


def read(path: Path) -> tuple[Counter[str], dict[str, int]]:
    with open_log(path) as log:
        kinds = Counter(type(event).__name__ for event in log.events())
        return kinds, log.counters


def test_messages_before_their_channel_are_counted_and_the_others_all_read(tmp_path: Path) -> None:
    path = mcap(
        tmp_path / "a.mcap",
        schema(1, ODOMETRY),
        message(1, odometry(1)),
        channel(1, 1, "/odom"),
        *(message(1, odometry(i)) for i in range(2, 6)),
    )
    with open_log(path) as log:
        assert [e.stamp_ns // S for e in log.events() if isinstance(e, Odometry)] == [2, 3, 4, 5]
        assert log.counters["skipped.unknown.no_channel"] == 1


def test_a_channel_that_is_defined_again_is_another_stream_from_there_on(tmp_path: Path) -> None:
    path = mcap(
        tmp_path / "a.mcap",
        schema(1, ODOMETRY),
        schema(2, IMU),
        channel(1, 1, "/odom"),
        *(message(1, odometry(i)) for i in range(1, 4)),
        channel(1, 2, "/imu"),
        *(message(1, cdr(Imu(i * S, "imu", 0.5))) for i in range(1, 4)),
        channel(1, 1, "/odom"),
        message(1, odometry(4)),
    )
    for _ in range(2):
        with open_log(path) as log:
            kinds = Counter(type(event).__name__ for event in log.events())
            assert (kinds["Odometry"], kinds["Imu"]) == (4, 3)
            assert any("channel 1 is defined again as /imu" in line for line in log.problems)
            assert log.counters["read.odom"] == 4


@pytest.mark.parametrize(
    ("definition", "encoding", "reason"),
    [
        ("%%%", "cdr", "unreadable_schema"),
        ("NoSuchType field\n", "cdr", "undecodable"),
        ("float64 x\nfloat64 x\n", "cdr", "unreadable_schema"),
        (None, "ros1", "unknown_encoding"),
    ],
)
def test_a_stream_that_cannot_be_decoded_is_counted_and_the_others_all_read(
    tmp_path: Path, definition: str | None, encoding: str, reason: str
) -> None:
    records = [
        schema(1, ODOMETRY),
        schema(2, IMU, definition),
        channel(1, 1, "/odom"),
        channel(2, 2, "/imu", encoding),
    ]
    for i in range(1, 6):
        records += [message(1, odometry(i)), message(2, cdr(Imu(i * S, "imu", 0.5)))]
    kinds, counters = read(mcap(tmp_path / "a.mcap", *records))
    assert kinds["Odometry"] == 5
    assert kinds["Imu"] == 0
    assert counters[f"skipped.imu.{reason}"] == 5


def test_only_a_file_that_did_change_is_said_to_have_changed(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with open_writer(path) as writer:
        for event in sample_events(200, 90):
            writer.write(event)
    whole = path.read_bytes()
    with open_log(path) as log:
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(LogError, match=r"log\.mcap.*while it was read"):
            list(log.events())


BOMBS: dict[str, Callable[[], bytes]] = {
    "a chunk of zeros": lambda: chunk(bytes(400_000_000)),
    "a chunk of empty records": lambda: chunk(record(0x90, b"") * 3_000_000),
    "twenty thousand damaged parts": lambda: (
        b"\x03" + b"".join(record(MESSAGE, b"\x01\x00" + bytes(20)) + b"\xff" * 60 for _ in range(20_000))
    ),
    "an enormous definition": lambda: (
        schema(3, SCAN, "float32 a\n" * 60_000) + channel(3, 3, "/big") + message(3, cdr_of_scan()) * 3
    ),
    "a channel that is defined again and again": lambda: b"".join(
        channel(7, 1, f"/odom{i}") + message(7, odometry(i)) for i in range(2000)
    ),
}


def chunk(data: bytes) -> bytes:
    packed = zstandard.ZstdCompressor().compress(data)
    head = CHUNK_HEAD.pack(0, 0, len(data), 0, 4)
    return record(CHUNK, head + b"zstd" + struct.pack("<Q", len(packed)) + packed)


def cdr_of_scan() -> bytes:
    return cdr(LaserScan(S, "laser", np.ones(3, np.float32), -1.0, 0.5, 0.125, 30.0))


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_small_mcap_file_costs_little_time_and_the_rest_of_it_is_read(tmp_path: Path, bomb: str) -> None:
    records = [schema(1, ODOMETRY), channel(1, 1, "/odom"), *(message(1, odometry(i)) for i in range(1, 6))]
    path = mcap(tmp_path / "a.mcap", *records, BOMBS[bomb]())
    assert path.stat().st_size < 4_000_000
    with limit(20):
        kinds, _ = read(path)
    assert kinds["Odometry"] >= 5


def database(path: Path, *statements: str) -> Path:
    with sqlite3.connect(path) as connection:
        connection.execute(
            "CREATE TABLE IF NOT EXISTS topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        for statement in statements:
            connection.execute(statement)
    connection.close()
    return path


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"


@pytest.mark.parametrize(
    "statement",
    [
        f"CREATE VIEW messages AS {ENDLESS} i AS id, 1 AS topic_id, i AS timestamp, zeroblob(1000000) AS data FROM n",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INT, timestamp INT, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(900000000)))",
        "CREATE VIRTUAL TABLE messages USING fts5(topic_id, data)",
    ],
)
def test_a_database_whose_messages_are_computed_is_refused(tmp_path: Path, statement: str) -> None:
    path = database(tmp_path / "a.db3", statement)
    with limit(10), pytest.raises(LogError, match=r"the table 'messages' is (a view|computed)"):
        open_log(path)


def test_a_database_whose_topics_are_a_view_or_missing_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    with sqlite3.connect(path) as connection:
        connection.execute(f"CREATE VIEW topics AS {ENDLESS} i AS id FROM n")
    connection.close()
    with limit(10), pytest.raises(LogError, match="the table 'topics' is a view"):
        open_log(path)


def test_messages_that_a_killed_recorder_left_in_the_write_ahead_log_are_read(tmp_path: Path) -> None:
    source = next(rosbag2(tmp_path / "bag").glob("*.db3"))
    folder = tmp_path / "killed"
    folder.mkdir()
    live = Path(shutil.copy(source, tmp_path / "live.db3"))
    connection = sqlite3.connect(live)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA wal_autocheckpoint = 0")
    kept = connection.execute("SELECT count(*) FROM messages").fetchone()[0]
    connection.execute(
        "INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages"
    )
    connection.commit()
    for name in ("live.db3", "live.db3-wal"):
        shutil.copy(tmp_path / name, folder / name)
    connection.close()
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    with open_log(folder / "live.db3") as log:
        found = sum(1 for event in log.events() if isinstance(event, LaserScan | Odometry))
        assert set(log.input_hashes()) == {"live.db3", "live.db3-wal"}
        assert any("live.db3-wal" in line for line in log.problems)
    assert found == 2 * (kept - 1)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


@pytest.mark.parametrize("kept_ratio", [0.0, 0.5, 0.9])
def test_a_write_ahead_log_that_is_cut_or_damaged_is_a_loss(tmp_path: Path, kept_ratio: float) -> None:
    live = Path(shutil.copy(next(rosbag2(tmp_path / "bag").glob("*.db3")), tmp_path / "live.db3"))
    connection = sqlite3.connect(live)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute(
        "INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, timestamp, data FROM messages"
    )
    connection.commit()
    target = Path(shutil.copy(live, tmp_path / "killed.db3"))
    recorded = Path(f"{live}-wal").read_bytes()
    connection.close()
    cut = recorded[: int(len(recorded) * kept_ratio)] or bytes(5000)
    Path(f"{target}-wal").write_bytes(cut)
    with open_log(target) as log:
        assert log.counters["lost.rest_of_write_ahead_log"] == 1
        assert log.is_lossy


@pytest.mark.parametrize("tail", [None, bytes(1000)])
def test_what_follows_the_end_of_a_recording_is_a_loss(tmp_path: Path, tail: bytes | None) -> None:
    with open_writer(tmp_path / "log.mcap") as writer:
        for event in sample_events(5):
            writer.write(event)
    whole = (tmp_path / "log.mcap").read_bytes()
    (tmp_path / "joined.mcap").write_bytes(whole + (whole if tail is None else tail))
    events, counters = read(tmp_path / "joined.mcap")
    assert events == read(tmp_path / "log.mcap")[0]
    assert counters["lost.rest_after_the_end"] == 1
    assert not any(key.startswith("lost") for key in read(tmp_path / "log.mcap")[1])


def test_messages_that_metadata_counts_and_the_file_lacks_are_a_loss(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag")
    connection = sqlite3.connect(next(bag.glob("*.db3")))
    with connection:
        connection.execute("DELETE FROM messages WHERE id % 2 = 0")
        missing = connection.execute("SELECT changes()").fetchone()[0]
    connection.close()
    _, counters = read(bag)
    assert counters["lost.messages"] == missing


def test_a_file_that_metadata_names_many_times_is_read_once_and_said(tmp_path: Path) -> None:
    bag = rosbag2(tmp_path / "bag")
    expected, _ = read(bag)
    metadata = bag / "metadata.yaml"
    name = next(bag.glob("*.db3")).name
    lines = re.sub(rf"\n( *- ){name}", rf"\n\1{name}" + rf"\n\1./{name}" * 50, metadata.read_text(), count=1)
    metadata.write_text(lines)
    with open_log(bag) as log:
        assert Counter(type(event).__name__ for event in log.events()) == expected
        assert any("names 51 files, of which 1 differ" in line for line in log.problems)


def test_reading_a_database_ends_on_an_interruption(tmp_path: Path) -> None:
    path = database(
        tmp_path / "a.db3",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INT, timestamp INT, data BLOB)",
        f"INSERT INTO messages(topic_id, timestamp, data) {ENDLESS} 1, i, zeroblob(100) FROM n LIMIT 300000",
    )
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a background job ignores it
        "from gridslam.logs import open_log\n"
        f"print('reading', flush=True)\nfor _ in range(1000): open_log({str(path)!r}).close()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=REPOSITORY,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(1.0)
    process.send_signal(2)
    _, errors = process.communicate(timeout=20)
    assert process.returncode != 0
    assert "KeyboardInterrupt" in errors


def test_an_endless_device_is_refused_as_trajectory_and_as_configuration() -> None:
    with limit(5):
        with pytest.raises(InputError, match=r"/dev/zero: cannot be read \(a device or a pipe"):
            read_trajectory(Path("/dev/zero"))
        with pytest.raises(ConfigError, match=r"/dev/zero: cannot be read \(a device or a pipe"):
            read_yaml(Path("/dev/zero"))


@pytest.mark.parametrize(("option", "config"), [("tags", "slam-sd"), ("drawing", "handmap-slam")])
def test_an_endless_device_is_refused_as_an_input_of_a_method(option: str, config: str) -> None:
    with (
        limit(5),
        pytest.raises(ConfigError, match=rf"--{option} /dev/zero: cannot be read \(a device or a pipe"),
    ):
        read_inputs({option: Path("/dev/zero")}, config)


def test_an_endless_device_is_refused_as_a_table_of_objects() -> None:
    with limit(5), pytest.raises(InputError, match=r"/dev/zero: cannot be read \(a device or a pipe"):
        read_objects(Path("/dev/zero"))


def test_a_trajectory_of_nothing_but_line_ends_costs_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "truth.tum"
    path.write_bytes(b"\n" * 1_000_000)
    tracemalloc.start()
    with limit(30), pytest.raises(InputError, match="no pose in it"):
        read_trajectory(path)
    assert tracemalloc.get_traced_memory()[1] < 5_000_000
    tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("sensor_msgs/msg/Laser; import os", [("x", (1, ("float64", 0)))]),
        ("3ensor_msgs/msg/LaserScan", [("x", (1, ("float64", 0)))]),
        ("../msg/Scan", [("x", (1, ("float64", 0)))]),
        ("a/msg/B", [("x\n    y: int = exit()", (1, ("float64", 0)))]),
        ("a/msg/B", [("__class__", (1, ("float64", 0)))]),
        ("a/msg/B", [("x", (1, ("float64'''", 0)))]),
        ("a/msg/B", [("x", (2, "c/msg/D']; exit() #"))]),
        ("a/msg/B", [("x", (3, ((1, ("float64", 0)), "9**9**9")))]),
        ("a/msg/B", [("x", (3, ((1, ("float64", 0)), 10**12)))]),
        ("a/msg/B", [("x", (1, ("float64", 0))), ("x", (1, ("float32", 0)))]),
        ("a/msg/B", [("class", (1, ("float64", 0))), ("class_", (1, ("float64", 0)))]),
        ("a/msg/B", [("x", (7, ("float64", 0)))]),
        ("é/msg/B", [("x", (1, ("float64", 0)))]),
    ],
)
def test_no_name_of_a_definition_becomes_code(name: str, fields: list[object]) -> None:
    with pytest.raises(BadDefinitionError):
        checked_types({name: ([], fields)})
    assert not is_valid(name, fields)


def test_constants_of_a_definition_are_not_passed_to_the_type_library() -> None:
    types = checked_types({"a/msg/B": ([("X", "string", "'); exit(")], [("x", (1, ("float64", 0)))])})
    assert types == {"a/msg/B": ([], [("x", (1, ("float64", 0)))])}


@pytest.mark.parametrize("name", ["ros2", "ros1"])
def test_every_definition_of_the_distributions_is_a_valid_one(name: str) -> None:
    store = get_typestore({"ros2": Stores.ROS2_HUMBLE, "ros1": Stores.ROS1_NOETIC}[name])
    assert all(is_valid(kind, fields) for kind, (_, fields) in store.fielddefs.items())


def test_the_same_damage_is_counted_alike_in_every_format(tmp_path: Path) -> None:
    nan = float("nan")
    events = [
        Transform(0, "base_link", "laser", (0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True),
        *(Odometry(i * S, "odom", nan if i == 3 else float(i), 0.0, 0.0) for i in range(1, 8)),
        *(
            LaserScan(i * S + 1, "laser", np.ones(3, np.float32), -1.0, 0.0 if i == 4 else 0.5, 0.125, 30.0)
            for i in range(1, 8)
        ),
        Imu(9 * S, "imu", nan),
    ]
    counts = {}
    for name in ("log.mcap", "log"):
        with open_writer(tmp_path / name) as writer:
            for event in events:
                writer.write(event)
        counts[name] = read(tmp_path / name)[1]
    counts["db3"] = read(as_database(tmp_path / "log.mcap", tmp_path / "log.db3"))[1]
    assert counts["log.mcap"] == counts["log"] == counts["db3"]
    assert counts["db3"]["skipped.scan.bad_angles"] == 1


def as_database(source: Path, target: Path) -> Path:
    """The messages of an MCAP file as a rosbag2 database."""
    file = McapFile(source, MessageCounts(), 1 << 29)
    messages = list(file.messages())
    with sqlite3.connect(target) as connection:
        connection.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        connection.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INT, timestamp INT, data BLOB)"
        )
        for number, described in file.channels.items():
            row = (number, described.topic, file.schemas[described.schema_id].name, described.encoding)
            connection.execute("INSERT INTO topics VALUES(?, ?, ?, ?)", row)
        connection.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, 0, ?)", messages)
    connection.close()
    return target


@pytest.mark.parametrize("name", ["log.yaml", "metadata.yaml", "odom.csv"])
def test_a_link_that_leaves_the_folder_of_a_log_is_not_followed(tmp_path: Path, name: str) -> None:
    secret = tmp_path / "secret"
    secret.write_text("password: 1\n")
    folder = tmp_path / "log"
    folder.mkdir()
    (folder / "imu.csv").write_text("stamp,wz\n1,0\n")
    (folder / name).symlink_to(secret)
    with pytest.raises(LogError, match="folder") as error:
        open_log(folder)
    assert "password" not in str(error.value)
