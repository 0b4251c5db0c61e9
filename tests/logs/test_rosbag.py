from __future__ import annotations

import re
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from gridslam.core.errors import LogError
from gridslam.core.messages import LaserScan, Odometry, Transform
from gridslam.logs import open_log
from gridslam.logs.find import find_logs
from tests.logs.ros_samples import HUMBLE, odometry, scan, tf, transform

S = 10**9
MESSAGES = [
    ("/tf_static", tf(transform(0, "base_link", "laser", (0.25, 0.0, 0.0)))),
    *((topic, make(i * S)) for i in range(1, 6) for topic, make in (("/odom", odometry), ("/scan", scan))),
]


def rosbag2(
    path: Path, plugin: StoragePlugin = StoragePlugin.SQLITE3, packed: CompressionMode | None = None
) -> Path:
    writer = Writer2(path, version=8, storage_plugin=plugin)
    if packed is not None:
        writer.set_compression(packed, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for number, (topic, message) in enumerate(MESSAGES):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=HUMBLE)
            writer.write(connections[topic], number, HUMBLE.serialize_cdr(message, kind))
    return path


def check(path: Path, name: str) -> None:
    with open_log(path, kinds=["scan", "odom"]) as log:
        first, *rest = log.events()
        assert log.format == name
        assert not log.is_lossy, log.problems
        assert log.input_hashes()
    assert isinstance(first, Transform)
    assert (first.child_frame_id, first.translation_m) == ("laser", (0.25, 0.0, 0.0))
    assert [type(e) for e in rest] == [Odometry, LaserScan] * 5
    assert [e.stamp_ns for e in rest] == [i * S for i in range(1, 6) for _ in range(2)]
    assert rest[1].ranges_m.tolist() == [1, 2, 3]


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_a_rosbag2_folder_is_read_whatever_its_storage(tmp_path: Path, plugin: StoragePlugin) -> None:
    check(rosbag2(tmp_path / "bag", plugin), "rosbag2")


def test_a_db3_file_alone_is_read(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "bag")
    path = Path(shutil.copy(next(folder.glob("*.db3")), tmp_path / "alone.db3"))
    check(path, "rosbag2")


@pytest.mark.parametrize("plugin", StoragePlugin)
@pytest.mark.parametrize("packed", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_packed_recording_is_read(tmp_path: Path, plugin: StoragePlugin, packed: CompressionMode) -> None:
    folder = rosbag2(tmp_path / "bag", plugin, packed)
    check(folder, "rosbag2")
    (folder / "metadata.yaml").unlink()
    if plugin is StoragePlugin.SQLITE3 or packed is CompressionMode.FILE:
        (alone,) = folder.iterdir()
        check(alone, "rosbag2")


def test_a_packed_file_that_is_cut_is_refused(tmp_path: Path) -> None:
    (path,) = rosbag2(tmp_path / "bag", packed=CompressionMode.FILE).glob("*.zstd")
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(LogError):
        open_log(path)


def parts(folder: Path, order: tuple[int, ...]) -> Path:
    """A recording in three parts with the messages 0-2, 3-5, 6-9 after the first; metadata names them in the given order."""
    folder.mkdir()
    whole = rosbag2(folder / "whole")
    (database,) = whole.glob("*.db3")
    for number, (first, last) in enumerate(((0, 3), (4, 6), (7, 10))):
        part = Path(shutil.copy(database, folder / f"drive_{number}.db3"))
        with sqlite3.connect(part) as connection:
            connection.execute("DELETE FROM messages WHERE timestamp < ? OR timestamp > ?", (first, last))
    names = "".join(f"  - old_name/drive_{i}.db3\n" for i in order)
    shutil.rmtree(whole)
    text = f"rosbag2_bagfile_information:\n  message_count: 11\n  relative_file_paths:\n{names}"
    (folder / "metadata.yaml").write_text(text)
    return folder


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_parts_are_joined_in_the_order_of_recording_with_and_without_metadata(
    tmp_path: Path, order: tuple[int, ...]
) -> None:
    folder = parts(tmp_path / "bag", order)
    check(folder, "rosbag2")
    (folder / "metadata.yaml").unlink()
    check(folder, "rosbag2")
    with open_log(folder) as log:
        assert any("metadata.yaml is missing" in line for line in log.problems)


def drives(folder: Path, shifts_s: tuple[float, ...]) -> Path:
    """A folder without metadata.yaml of drive_1, drive_2, ...: each lasts 10 s from its shift on."""
    whole = rosbag2(folder / "whole")
    (database,) = whole.glob("*.db3")
    for number, shift_s in enumerate(shifts_s, 1):
        drive = Path(shutil.copy(database, folder / f"drive_{number}.db3"))
        with sqlite3.connect(drive) as connection:
            connection.execute("UPDATE messages SET timestamp = timestamp * 1000000000 + ?", (shift_s * 1e9,))
    shutil.rmtree(whole)
    return folder


@pytest.mark.parametrize(
    ("shifts_s", "reason"),
    [
        ((0.0, 70.0), "60.0 s lie between drive_1.db3 and drive_2.db3"),
        ((0.0, 10.5, 30.0), "9.5 s lie between drive_2.db3 and drive_3.db3"),
        ((70.0, 0.0), "60.0 s lie between drive_2.db3 and drive_1.db3"),
        ((0.0, 3.0), "drive_1.db3 and drive_2.db3 were recorded at the same time"),
    ],
)
def test_drives_of_other_times_are_logs_of_their_own(
    tmp_path: Path, shifts_s: tuple[float, ...], reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    folder = drives(tmp_path, shifts_s)
    with pytest.raises(LogError, match=re.escape(reason)):
        open_log(folder)
    assert find_logs(folder) == sorted(folder.glob("*.db3"))
    assert reason in caplog.text


def test_a_part_begins_where_the_one_before_ends(tmp_path: Path) -> None:
    folder = drives(tmp_path, (0.0, 10.4, 19.9))
    assert find_logs(folder) == [folder]
    with open_log(folder) as log:
        assert any(
            "drive_1.db3, drive_2.db3, drive_3.db3 read one after the other" in p for p in log.problems
        )


def test_a_folder_with_recordings_of_two_names_is_not_joined(tmp_path: Path) -> None:
    folder = parts(tmp_path / "bag", (0, 1, 2))
    (folder / "metadata.yaml").unlink()
    (folder / "drive_2.db3").rename(folder / "other.db3")
    with pytest.raises(LogError, match="name one of them"):
        open_log(folder)


def test_a_damaged_db3_gives_what_can_be_read(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "bag")
    path = next(folder.glob("*.db3"))
    with sqlite3.connect(path) as database:
        rows = [(6, i, np.random.default_rng(i).bytes(3000)) for i in range(100)]
        database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    whole = path.read_bytes()
    place = len(whole) // 2
    path.write_bytes(whole[:place] + b"\x55" * 8192 + whole[place + 8192 :])
    with open_log(path) as log:
        assert sum(isinstance(e, LaserScan) for e in log.events()) == 5
        assert log.counters["lost.rest_of_database"] == 1
    path.write_bytes(whole[:place])
    with pytest.raises(LogError, match="not a readable rosbag2 database"):
        open_log(path)


def test_metadata_that_leads_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "bag")
    path = next(folder.glob("*.db3"))
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace(path.name, f"../{path.name}"))
    shutil.move(path, tmp_path / path.name)
    with pytest.raises(LogError, match="is not a file in this folder"):
        open_log(folder)


@pytest.mark.parametrize(
    "text", ["", "- a\n", "&a [*a]", "a: !!int ''", "a: [", "rosbag2_bagfile_information: 5\n"]
)
def test_metadata_that_is_none_is_an_unreadable_log(tmp_path: Path, text: str) -> None:
    folder = rosbag2(tmp_path / "bag")
    (folder / "metadata.yaml").write_text(text)
    with pytest.raises(LogError, match=r"metadata\.yaml"):
        open_log(folder)


def test_a_folder_of_metadata_alone_is_an_unreadable_log(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    with pytest.raises(LogError, match=r"metadata\.yaml: says nothing of a recording"):
        open_log(tmp_path)


def ros1_types() -> Any:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register({"tf2_msgs/msg/TFMessage": HUMBLE.fielddefs["tf2_msgs/msg/TFMessage"]})
    return store


def ros1(path: Path) -> Path:
    store = ros1_types()
    with Writer1(path) as writer:
        connections = {}
        for number, (topic, message) in enumerate(MESSAGES, 1):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            data = HUMBLE.serialize_cdr(message, kind)
            writer.write(connections[topic], number, HUMBLE.cdr_to_ros1(data, kind))
    return path


def test_a_ros1_bag_is_read(tmp_path: Path) -> None:
    check(ros1(tmp_path / "a.bag"), "ROS 1 bag")


def test_ros1_messages_in_mcap_are_read(tmp_path: Path) -> None:
    from mcap.writer import Writer

    store, path, channels = ros1_types(), tmp_path / "a.mcap", {}
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros1")
        for number, (topic, message) in enumerate(MESSAGES):
            kind = message.__msgtype__
            if topic not in channels:
                text, _ = store.generate_msgdef(kind)
                schema = writer.register_schema(kind.replace("/msg/", "/"), "ros1msg", text.encode())
                channels[topic] = writer.register_channel(topic, "ros1", schema)
            data = HUMBLE.cdr_to_ros1(HUMBLE.serialize_cdr(message, kind), kind)
            writer.add_message(channels[topic], number, bytes(data), number)
        writer.finish()
    check(path, "MCAP")


def test_the_tf_messages_of_early_ros1_are_read(tmp_path: Path) -> None:
    store, path = ros1_types(), tmp_path / "early.bag"
    message = tf(transform(5 * S, "odom", "base_link", (1.0, 2.0, 0.0)))
    data = HUMBLE.cdr_to_ros1(HUMBLE.serialize_cdr(message, message.__msgtype__), message.__msgtype__)
    text, _ = store.generate_msgdef("tf2_msgs/msg/TFMessage")
    with Writer1(path) as writer:
        connection = writer.add_connection("/tf", "tf/msg/tfMessage", msgdef=text, md5sum="0" * 32)
        writer.write(connection, 1, data)
    with open_log(path, kinds=["odom"]) as log:
        (found,) = log.events()
    assert isinstance(found, Odometry)
    assert (found.x_m, found.y_m) == (1.0, 2.0)


def test_a_cut_ros1_bag_is_refused_with_what_may_help(tmp_path: Path) -> None:
    path = ros1(tmp_path / "a.bag")
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(LogError, match="rosbag reindex"):
        open_log(path)
