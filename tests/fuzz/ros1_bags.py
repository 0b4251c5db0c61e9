"""ROS 1 bags with changed connections, definitions and payloads, put together again with right lengths and indexes."""

from __future__ import annotations

import random
import struct
from functools import cache
from pathlib import Path

from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from tests.fuzz.damage import NAMES, changed
from tests.logs.ros_samples import HUMBLE

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE_DATA, BAG_HEADER, INDEX_DATA, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7
TIME = struct.pack("<II", 1, 0)
FIELD_LINES = [
    "float64 x",
    "uint8[4294967295] x",
    "string x",
    "x",
    "float64[] ranges",
    "3bad x",
    "int32 class",
]

Connection = tuple[str, str, str, bytes]  # topic, type, definition, MD5 sum


@cache
def sample(path: Path) -> tuple[dict[int, Connection], list[tuple[int, bytes]]]:
    """The connections and messages, as ROS 1 has them, of an MCAP file."""
    file = McapFile(path, MessageCounts(), 1 << 29)
    connections: dict[int, Connection] = {}
    for number, channel in file.channels.items():
        kind = file.schemas[channel.schema_id].name
        definition, digest = HUMBLE.generate_msgdef(kind, ros_version=1)
        connections[number] = (channel.topic, kind.replace("/msg/", "/"), definition, digest.encode())
    names = {number: file.schemas[channel.schema_id].name for number, channel in file.channels.items()}
    messages = [(i, bytes(HUMBLE.cdr_to_ros1(data, names[i]))) for i, data in file.messages()]
    return connections, messages


def fuzz_bag(path: Path, mcap: Path, rng: random.Random) -> Path:
    """A bag of one chunk."""
    connections, messages = sample(mcap)
    heads = {i: _connection(i, connection, rng) for i, connection in connections.items()}
    chunk, offsets = bytearray(), dict.fromkeys(heads, b"")
    for head in heads.values():
        chunk += head
    for i, data in messages:
        i = rng.choice(list(heads)) if rng.random() < 0.03 else i
        offsets[i] += TIME + struct.pack("<I", len(chunk))
        body = changed(data, rng) if rng.random() < 0.15 else data
        chunk += _record({b"op": bytes([MESSAGE_DATA]), b"conn": struct.pack("<I", i), b"time": TIME}, body)
    head_size = len(MAGIC) + 4096
    sized = {b"op": bytes([CHUNK]), b"compression": b"none", b"size": struct.pack("<I", len(chunk))}
    parts = [_record(sized, bytes(chunk))]
    for i, entries in offsets.items():
        numbers = {b"ver": 1, b"conn": i, b"count": len(entries) // 12}
        fields = {name: struct.pack("<I", value) for name, value in numbers.items()}
        parts.append(_record({b"op": bytes([INDEX_DATA]), **fields}, entries))
    index_at = head_size + sum(map(len, parts))
    counts = b"".join(struct.pack("<II", i, len(e) // 12) for i, e in offsets.items())
    info = {
        b"op": bytes([CHUNK_INFO]),
        b"ver": struct.pack("<I", 1),
        b"chunk_pos": struct.pack("<Q", head_size),
    }
    info |= {b"start_time": TIME, b"end_time": TIME, b"count": struct.pack("<I", len(offsets))}
    parts += [*heads.values(), _record(info, counts)]
    path.write_bytes(MAGIC + _bag_header(index_at, len(heads)) + b"".join(parts))
    return path


def _connection(number: int, connection: Connection, rng: random.Random) -> bytes:
    """The record of a connection; in some, one of its texts or its definition is changed."""
    topic, kind, definition, digest = connection
    texts = {b"topic": topic.encode(), b"type": kind.encode(), b"md5sum": digest}
    if rng.random() < 0.1:
        texts[rng.choice(list(texts))] = rng.choice(
            [*NAMES, b"sensor_msgs/Imu", b"a/b/c", b"3x/Y", b"std_msgs/Header"]
        )
    if rng.random() < 0.15:
        lines = definition.split("\n")
        at = rng.randrange(len(lines))
        lines[at : at + rng.randrange(2)] = [rng.choice([*FIELD_LINES, *lines])]
        definition = "\n".join(lines)
    texts[b"message_definition"] = definition.encode()
    if rng.random() < 0.03:
        texts[b"message_definition"] = changed(definition.encode(), rng)
    if rng.random() < 0.03:
        texts.pop(rng.choice(list(texts)))
    head = {b"op": bytes([CONNECTION]), b"conn": struct.pack("<I", number), b"topic": topic.encode()}
    return _record(head, _header(texts))


def _header(fields: dict[bytes, bytes]) -> bytes:
    return b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in fields.items())


def _record(fields: dict[bytes, bytes], data: bytes) -> bytes:
    head = _header(fields)
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def _bag_header(index_at: int, connections: int) -> bytes:
    """The first record, padded to 4096 bytes."""
    fields = {b"op": bytes([BAG_HEADER]), b"index_pos": struct.pack("<Q", index_at)}
    fields |= {b"conn_count": struct.pack("<I", connections), b"chunk_count": struct.pack("<I", 1)}
    head = _header(fields)
    return _record(fields, b" " * (4096 - 8 - len(head)))
