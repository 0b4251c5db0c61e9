"""rosbag2 folders as other readers and our own read them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from rosbags.interfaces import Qos, QosDurability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from gridslam.core.errors import ConfigError
from gridslam.logs import open_log
from gridslam.logs.convert import convert_log
from gridslam.logs.rosbag.writer import Rosbag2Writer


@pytest.fixture
def bag(small_log: Path, tmp_path: Path) -> Path:
    with open_log(small_log) as log:
        convert_log(log, tmp_path / "bag", as_rosbag2=True)
    return tmp_path / "bag"


def test_another_reader_finds_every_message(bag: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(bag) as reader:
        promised = {connection.topic: connection.msgcount for connection in reader.connections}
        found: Counter[str] = Counter()
        for connection, _, data in reader.messages():
            store.deserialize_cdr(data, connection.msgtype)
            found[connection.topic] += 1
        assert found == promised == {"/odom": 60, "/scan": 60, "/ground_truth": 60, "/tf_static": 1}
        assert reader.message_count == 181
        (latched,) = (c for c in reader.connections if c.topic == "/tf_static")
        (qos,) = latched.ext.offered_qos_profiles
        assert isinstance(qos, Qos)
        assert qos.durability == QosDurability.TRANSIENT_LOCAL


def test_it_reads_back_as_the_same_events(bag: Path, small_log: Path) -> None:
    with open_log(bag) as log, open_log(small_log) as original:
        assert log.format == "rosbag2"
        assert not log.is_lossy, log.problems
        stamps = [[event.stamp_ns for event in opened.events()] for opened in (log, original)]
    assert stamps[0] == stamps[1]


def test_only_a_rosbag2_folder_is_replaced(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--force"):
        Rosbag2Writer(bag)
    Rosbag2Writer(bag, force=True).abandon()
    assert (bag / "metadata.yaml").is_file()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="not a rosbag2 folder"):
        Rosbag2Writer(tmp_path / "mine", force=True)
    with pytest.raises(ConfigError, match="is not a folder"):
        Rosbag2Writer(tmp_path / "nowhere" / "bag")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag", "mine"]
