"""Logs changed by their structure.

Records of MCAP, CDR payloads, definitions, cells of SQLite and of CSV files are changed and put together again with right
lengths and checksums, so that the damage reaches the decoders. `tests.fuzz.many` runs them by the thousand.
"""

from __future__ import annotations

import random
import shutil
import sqlite3
import struct
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import zstandard

from gridslam.core.errors import GridslamError
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
)
from gridslam.logs.config import LogConfig, LogLimits
from gridslam.logs.convert import convert_log
from gridslam.logs.kinds import TRUTH_TOPIC
from gridslam.logs.log import Log
from gridslam.logs.mcap.chunks import CHUNK_HEAD
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.mcap.records import CHANNEL, CHUNK, HEADER, MAGIC, MESSAGE, RECORD, SCHEMA
from gridslam.logs.mcap.summary import FOOTER_BYTES
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.open import open_log
from gridslam.logs.write import open_writer
from tests.fuzz.damage import NAMES, NUMBERS, changed
from tests.fuzz.dataset_folders import fuzz_dataset
from tests.fuzz.foreign_messages import fuzz_foreign
from tests.fuzz.hdf5_files import fuzz_hdf5
from tests.fuzz.rawlogs import fuzz_rawlog
from tests.fuzz.ros1_bags import fuzz_bag
from tests.fuzz.text_logs import fuzz_carmen

S = 10**9
CONFIG = LogConfig(limits=LogLimits(chunk_mb=16, line_mb=1, reorder_mb=16))


def sample_events() -> list[tuple[str | None, Event]]:
    """Events of every kind, a few of each."""
    events: list[tuple[str | None, Event]] = [
        (None, Transform(S, "base_link", "laser", (0.1, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), is_static=True))
    ]
    for i in range(1, 4):
        t = i * S
        events += [
            ("/scan", LaserScan(t, "laser", np.ones(5, np.float32), -1.0, 0.5, 0.125, 30.0)),
            ("/odom", Odometry(t, "odom", float(i), 0.0, 0.1, 0.5, 0.1)),
            (TRUTH_TOPIC, Odometry(t, "map", float(i), 0.0, 0.1)),
            ("/imu", Imu(t, "imu", 0.25)),
            ("/wheels", WheelTicks(t, "base_link", 0.5 * i, 0.25 * i)),
            ("/ir", Range(t, "ir", 0.1 * i, 1.0, 0.125, 2.0)),
            ("/tags", TagInventory(t, "ant", "left", ("a", "b"), (-40.0, -50.0))),
            ("/pose", AbsolutePose(t, "map", np.array([1.0, 2.0, 0.5]), np.eye(3))),
            ("/c/image", Image(t, "cam", np.zeros((3, 4), np.uint8), "c")),
            ("/c/depth", DepthImage(t, "cam", np.ones((3, 4), np.float32), "c")),
            ("/c/disparity", Disparity(t, "cam", np.ones((3, 4), np.float32), 100.0, 0.5, "c")),
            ("/c/camera_info", CameraInfo(t, "cam", 4, 3, np.eye(3), np.eye(3, 4), np.zeros(5), "c")),
            ("/tf", Transform(t, "odom", "wheel", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))),
        ]
    return events


def write_sample(path: Path) -> Path:
    with open_writer(path) as writer:
        for topic, event in sample_events():
            writer.write(event, topic)
    return path


def fuzz_mcap(path: Path, sample: Path, rng: random.Random) -> Path:
    """An MCAP file without chunks whose records are changed, repeated, exchanged or left out."""
    file = McapFile(sample, MessageCounts(), 1 << 29)
    messages = list(file.messages())

    def text(value: bytes) -> bytes:
        return struct.pack("<I", len(value)) + value

    records: list[tuple[int, bytes]] = []
    for number, schema in file.schemas.items():
        data = changed(schema.data, rng) if rng.random() < 0.05 else schema.data
        name = rng.choice(list(file.schemas.values())).name if rng.random() < 0.03 else schema.name
        records.append(
            (SCHEMA, struct.pack("<H", number) + text(name.encode()) + text(b"ros2msg") + text(data))
        )
    for number, channel in file.channels.items():
        topic = rng.choice(NAMES) if rng.random() < 0.05 else channel.topic.encode()
        encoding = rng.choice((b"json", b"ros1", b"")) if rng.random() < 0.03 else b"cdr"
        schema_id = rng.choice(list(file.schemas)) if rng.random() < 0.05 else channel.schema_id
        records.append(
            (CHANNEL, struct.pack("<HH", number, schema_id) + text(topic) + text(encoding) + text(b""))
        )
    for number, data in messages:
        body = changed(data, rng) if rng.random() < 0.15 else data
        number = rng.choice(list(file.channels)) if rng.random() < 0.03 else number
        records.append((MESSAGE, struct.pack("<HIQQ", number, 0, 0, 0) + body))
    for _ in range(rng.choice((0, 0, 1, 3))):
        a, b = rng.randrange(len(records)), rng.randrange(len(records))
        records[a], records[b] = records[b], rng.choice((records[a], records[b]))
    parts = [MAGIC, struct.pack("<BQ", HEADER, 8) + text(b"") + text(b"")]
    framed = [struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records]
    parts += _in_chunks(framed, rng) if rng.random() < 0.5 else framed
    path.write_bytes(b"".join(parts))
    return path


def fuzz_summary(path: Path, sample: Path, rng: random.Random) -> Path:
    """An MCAP file whose summary says other places, counts and times than the data, with a right checksum or none."""
    data = bytearray(sample.read_bytes())
    foot = len(data) - FOOTER_BYTES + RECORD.size
    (start,) = struct.unpack_from("<Q", data, foot)
    for _ in range(rng.choice((1, 1, 3, 8))):
        if rng.random() < 0.1:
            struct.pack_into(
                "<Q",
                data,
                foot + rng.choice((0, 8)),
                rng.choice((0, 8, start - 9, start + 1, 2**63, len(data))),
            )
            continue
        at = rng.randrange(start, foot - RECORD.size)
        if rng.random() < 0.6:
            data[at] = rng.randrange(256)
        else:
            number = rng.choice((0, 1, 8, 2**31, 2**63, len(data), rng.randrange(len(data))))
            struct.pack_into("<Q", data, min(at, foot - RECORD.size - 8), number)
    crc = zlib.crc32(data[start : foot + 16]) if rng.random() < 0.7 else 0
    struct.pack_into("<I", data, foot + 16, crc)
    path.write_bytes(data)
    return path


def _in_chunks(records: list[bytes], rng: random.Random) -> list[bytes]:
    """The records in compressed chunks with right checksums; one in a hundred says a wrong size."""
    chunks = []
    size = rng.choice((3, 20, len(records)))
    for start in range(0, len(records), size):
        data = b"".join(records[start : start + size])
        packed = zstandard.compress(data)
        unpacked = rng.choice((0, 1, 2**62)) if rng.random() < 0.01 else len(data)
        head = CHUNK_HEAD.pack(0, 0, unpacked, zlib.crc32(data), 4) + b"zstd" + struct.pack("<Q", len(packed))
        chunks.append(struct.pack("<BQ", CHUNK, len(head) + len(packed)) + head + packed)
    return chunks


def fuzz_database(path: Path, sample: Path, rng: random.Random) -> Path:
    """A rosbag2 database whose cells are changed, also in type."""
    file = McapFile(sample, MessageCounts(), 1 << 29)
    messages = list(file.messages())
    odd: tuple[object, ...] = (None, -1, 2**40, 1.5, "text", b"\xff\xfe", "", "\x1b[31m")

    def cell(value: object, chance: float) -> object:
        return rng.choice(odd) if rng.random() < chance else value

    path.unlink(missing_ok=True)
    connection = sqlite3.connect(path)
    with connection:
        connection.execute("CREATE TABLE topics(id, name, type, serialization_format)")
        connection.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        for number, channel in file.channels.items():
            kind = file.schemas[channel.schema_id].name
            row = [cell(v, 0.03) for v in (number, channel.topic, kind, channel.encoding)]
            connection.execute("INSERT INTO topics VALUES(?, ?, ?, ?)", row)
        for number, data in messages:
            body = changed(data, rng) if rng.random() < 0.1 else data
            connection.execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, 0, ?)",
                (cell(number, 0.03), cell(body, 0.03)),
            )
    connection.close()
    return path


def fuzz_folder(path: Path, sample: Path, rng: random.Random) -> Path:
    """A CSV folder whose cells are changed, moved or left out."""
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(sample, path)
    for table in rng.sample(sorted(path.glob("*.csv")), 3):
        lines = [line.split(",") for line in table.read_text().splitlines()]
        for _ in range(rng.randrange(1, 4)):
            row = rng.choice(lines)
            at = rng.randrange(len(row))
            row[at] = rng.choice((*NUMBERS, rng.choice(rng.choice(lines)), rng.choice(NAMES[:5]).decode()))
            if rng.random() < 0.1:
                row.pop(at)
        table.write_text("\n".join(",".join(row) for row in lines) + "\n")
    return path


MAKERS: dict[str, Callable[[Path, Path, random.Random], Path]] = {
    "mcap": fuzz_mcap,
    "db3": fuzz_database,
    "csv": fuzz_folder,
    "bag": fuzz_bag,
    "summary": fuzz_summary,
    "rawlog": fuzz_rawlog,
    "h5": fuzz_hdf5,
    "dataset": fuzz_dataset,
    "clf": fuzz_carmen,
    "foreign": fuzz_foreign,
}


def usable_messages(log: Log) -> dict[str, int]:
    """The messages by topic that `info` counts, after all were looked at: they are what a conversion writes."""
    counts: Counter[str] = Counter()
    for info in log.streams:
        if info.used or info.kind == "truth":
            counts[info.topic] += info.count
    return dict(sorted((+counts).items()))


def check(path: Path, folder: Path, config: LogConfig = CONFIG) -> str:
    """Read a log and convert it there and back; the outcome in a word.

    What was written is read back without a loss, and no chain of conversions loses a message that it wrote.
    """
    written: list[Counter[str]] = []
    try:
        for number, suffix in enumerate((".mcap", "", ".mcap")):
            with open_log(path, config if number == 0 else CONFIG) as log:
                converted = folder / f"out{number}{suffix}"
                done = convert_log(log, converted, force=True)
                assert number == 0 or not log.is_lossy, log.problems
                assert len(log.problems) < 200
                if number != 1:  # a folder of tables has no point clouds
                    assert usable_messages(log) == done.written, log.problems
                kinds = Counter(
                    {kind: count for kind, count in log.counters.items() if kind.startswith("read.")}
                )
            written.append(kinds)
            path = converted
            if not done.written:
                break
    except GridslamError as error:
        is_for_mcap = "name the output OUT.mcap" in str(error)  # what a CSV file cannot hold
        assert is_for_mcap or not written, f"the converted log is refused: {error}"
        assert "\n" not in str(error) and len(str(error)) < 4000
        return type(error).__name__
    first = written[min(1, len(written) - 1)]
    assert first["read.cloud"] or written[-1] == first, written  # clouds are left out of tables
    return "read"
