"""Message definitions made to cost far more than their size, or to become code: each is refused, or read for what it is."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zstandard
from rosbags.typesys import get_types_from_idl

from gridslam.logs import open_log
from gridslam.logs.mcap.records import CHUNK
from gridslam.logs.ros import foxglove, protobuf, type_store, types
from gridslam.logs.ros.container import Schema
from gridslam.logs.ros.definitions import BadDefinitionError
from gridslam.logs.ros.idl import types_of_idl
from gridslam.logs.ros.ros1 import Ros1Types
from gridslam.logs.ros.types import decoder_of, ros2_types
from tests.logs.test_hostile_files import channel, mcap, message, read, record, schema, text

SCAN = "sensor_msgs/msg/LaserScan"
LONGEST_S = 2.0  # of CPU time; the work takes hundredths of a second, and hours where nothing bounds it
SEPARATOR = "=" * 80 + "\nMSG: "
ELEMENT = f"{SEPARATOR}q/E\nint8 a\n"


@pytest.fixture(autouse=True)
def _bounded_time() -> Iterator[None]:
    before = time.process_time()
    yield
    assert time.process_time() - before < LONGEST_S


def decode(definition: str, data: bytes, encoding: str = "ros2msg") -> object:
    return decoder_of(Schema(SCAN, encoding, definition.encode()), SCAN)(data)


def idl(inside: str, fields: str = "long a;") -> str:
    return f"module sensor_msgs {{ module msg {{ {inside} struct LaserScan {{ {fields} }}; }}; }};"


@pytest.mark.parametrize(
    "definition",
    [
        "string[1000000] x\n",
        f"q/E[1000000] x\n{ELEMENT}",
        f"q/E[0] x\n{ELEMENT}",
        "LaserScan x\n",
        f"q/E[] x\n{SEPARATOR}q/E\nq/F a\n{SEPARATOR}q/F\nq/E[] a\n",
        f"q/E[] x\n{SEPARATOR}q/E\n",
        f"q/E0 x\n{''.join(f'{SEPARATOR}q/E{i}{chr(10)}q/E{i + 1} a{chr(10)}' for i in range(25))}{SEPARATOR}q/E25\nint8 a\n",
        f"q/E0 x\n{''.join(f'{SEPARATOR}q/E{i}{chr(10)}q/E{i + 1}[2] a{chr(10)}' for i in range(30))}",
        "".join(f"int8 a{i}\n" for i in range(900)),
    ],
    ids=["texts", "structures", "none", "itself", "circle", "empty", "deep", "doubled", "fields"],
)
def test_a_type_whose_cost_its_messages_do_not_bound_is_refused(definition: str) -> None:
    with pytest.raises(ValueError, match="cannot be understood"):
        decode(definition, bytes(100))
    assert Ros1Types([(SCAN, definition)]).to_cdr(b"\xff\xff\xff\xff" + bytes(100), SCAN) == b""


@pytest.mark.parametrize(
    ("definition", "data"),
    [
        (f"q/E[] x\n{ELEMENT}", struct.pack("<I", 2000) + bytes(2000)),
        (f"q/E[] x\n{SEPARATOR}q/E\nfloat32[] a\n", struct.pack("<I", 500) + bytes(2000)),
        ("string[] x\n", struct.pack("<I", 400) + b"\1\0\0\0\0\0\0\0" * 400),
    ],
)
def test_a_message_of_very_many_parts_cannot_be_decoded(
    monkeypatch: pytest.MonkeyPatch, definition: str, data: bytes
) -> None:
    assert decode(definition, b"\0\1\0\0" + data)
    monkeypatch.setattr(type_store, "MAX_STRUCTURES", 300)
    monkeypatch.setattr(type_store, "_MAX_TEXTS_BYTES", 1500)
    types.decoder_of.cache_clear()
    with pytest.raises(ValueError, match=r"not a|lists of texts"):
        decode(definition, b"\0\1\0\0" + data)
    if "string" not in definition:
        assert Ros1Types([(SCAN, definition)]).to_cdr(data, SCAN) == b""


@pytest.mark.parametrize(
    "inside",
    [
        "module C { const long A = 1 << 99999999999; const long B = A * A; };",
        "module C { const long A = ((((((((((((1)))))))))))); };",
        f"module C {{ const long A = {'9' * 50_000}; }};",
        f"module C {{ {''.join(f'const long A{i} = A{i - 1};' for i in range(2000))} }};",
        f"struct B {{ @a(b={'(' * 5000}1{')' * 5000}) long a; }};",
        f"struct B {{ {'@a ' * 5000} long a; }};",
        f"/* {'* /' * 10_000} */",
        f"enum E {{ {'a @value(1), ' * 2000} b }};",
        "struct B;",
    ],
)
def test_what_is_no_structure_is_passed_over_in_idl(inside: str) -> None:
    assert types_of_idl(idl(inside))[SCAN] == ([], [("a", (1, ("int32", 0)))])


@pytest.mark.parametrize(
    "inside",
    [
        "struct B { sequence<sequence<sequence<long> > > a; };",
        "struct B { long a[1 << 20]; };",
        "struct B { long a[-5]; };",
        "struct B { long a[3][3]; };",
        "struct B { long a[X]; };",
        "struct B { unsigned double a; };",
        "typedef A A; struct B { A a; };",
        "typedef D A; typedef A D; struct B { A a; };",
        "union U switch (long) { case 1: long a; };",
        "/* " * 10_000,
        "module a {" * 50 + "struct B { long a; };" + "};" * 50,
        "struct B { long a",
        "}",
        "struct B { long \u00e4; };",
    ],
)
def test_idl_beyond_what_ros_uses_is_an_error(inside: str) -> None:
    with pytest.raises(BadDefinitionError):
        types_of_idl(idl(inside))


def test_definitions_in_idl_are_read_as_the_type_library_reads_them() -> None:
    text_of_types = """
    #include "x.idl"
    module geometry_msgs { module msg { struct Point { double x; double y; }; }; };
    module sensor_msgs { module msg {
      typedef double double__36[36];
      typedef geometry_msgs::msg::Point points__2[2];
      typedef sequence<octet> bytes;
      module LaserScan_Constants { @verbatim (language="comment", text="a ; } b" "c") const uint8 COUNT = 4; };
      enum Mode { A, B };
      @verbatim (language="comment", text= "What it is")
      struct LaserScan {
        @default (value=5) long long a; // its comment
        unsigned short b; boolean c; octet d; float e; string f; string<10> g; wstring h; long double i; unsigned long long j;
        sequence<double> k; sequence<float, 10> l; sequence<string<5>, 3> m; double__36 n; points__2 o; bytes p;
        @unit (value="m") geometry_msgs::msg::Point q; sequence<geometry_msgs::msg::Point> r; long s[3], t; uint8 u;
      };
    }; };
    """
    library = get_types_from_idl(text_of_types.replace('#include "x.idl"', ""))
    assert types_of_idl(text_of_types) == {name: ([], fields) for name, (_, fields) in library.items()}


def test_each_further_definition_of_a_log_is_unreadable_when_there_are_too_many(tmp_path: Path) -> None:
    standard, _ = ros2_types().generate_msgdef(SCAN, ros_version=2)
    records = []
    for number in range(1, types.MAX_DEFINITIONS + 11):
        records += [
            schema(number, SCAN, f"# {number}\n{standard}"),
            channel(number, number, f"/scan{number}"),
            message(number, b"\0\1\0\0" + struct.pack("<iI", 1, 0) + bytes(100)),
        ]
    _, counters = read(mcap(tmp_path / "many.mcap", *records))
    assert counters["skipped.scan.unreadable_schema"] == 10


def test_chunks_that_unpack_to_far_more_than_the_file_are_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gridslam.logs.mcap.chunks._ALWAYS_UNPACKED", 2_000_000)
    packed = zstandard.ZstdCompressor().compress(record(0x80, bytes(1_000_000)))
    chunk = record(
        CHUNK,
        struct.pack("<QQQI", 0, 0, 1_000_009, 0) + text("zstd") + struct.pack("<Q", len(packed)) + packed,
    )
    path = mcap(tmp_path / "chunks.mcap", *[chunk] * 300)
    factor = 1_000_009 * 300 / path.stat().st_size
    assert factor > 1000
    with open_log(path) as log:
        assert log.counters["lost.chunk_of_impossible_size"] == pytest.approx(
            300 * (1 - 1000 / factor), abs=2
        )


def varint(value: int) -> bytes:
    low, rest = value & 127, value >> 7
    return bytes([low | 128]) + varint(rest) if rest else bytes([low])


def block(number: int, body: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(body)) + body


def numeric_field(name: str, number: int, kind: int, of: str = "") -> bytes:
    return block(
        2,
        block(1, name.encode()) + varint(3 << 3) + varint(number) + varint(4 << 3) + varint(3) + varint(5 << 3) + varint(kind)
        + block(6, of.encode()),
    )  # fmt: skip


def descriptor(*messages: bytes) -> bytes:
    return block(1, b"".join(block(4, body) for body in messages))


def test_protobuf_messages_of_very_many_values_cannot_be_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = block(1, b"Wide") + b"".join(numeric_field(f"f{i}", i + 1, 5) for i in range(100))
    top = block(1, b"Top") + numeric_field("wide", 1, 11, ".Wide") + numeric_field("numbers", 2, 5)
    decoder = protobuf.decoder_of(descriptor(top, wide), "Top")
    hostile = block(1, b"") * 50, block(2, b"\1" * 2000), block(2, b"\1") * 2000, block(9, b"") * 2000
    for data in hostile:
        assert decoder(data)
    monkeypatch.setattr(protobuf, "_MAX_VALUES", 1000)
    for data in hostile:
        with pytest.raises(ValueError, match="values in a message"):
            decoder(data)


def test_protobuf_schemas_larger_than_any_real_one_are_refused() -> None:
    named = block(1, b"N" * 2000) + b"".join(block(3, block(1, b"m")) for _ in range(900))
    with pytest.raises(ValueError, match="a name longer"):
        protobuf.decoder_of(descriptor(named), "m")
    with pytest.raises(ValueError, match="larger than any real one"):
        protobuf.decoder_of(bytes(protobuf._MAX_SCHEMA_BYTES + 1), "m")


def test_json_of_very_many_parts_cannot_be_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    documents = [b'{"a": [%s]}' % b",".join([part] * 2000) for part in (b"{}", b"[]", b"1.5")]
    for document in documents:
        assert foxglove.parse(document)
    monkeypatch.setattr(foxglove, "_MAX_PARTS", 1000)
    for document in documents:
        with pytest.raises(ValueError, match="values in a message"):
            foxglove.parse(document)


def test_a_log_of_a_thousand_topics_is_selected_from_in_a_moment(tmp_path: Path) -> None:
    data = b"\0\1\0\0" + struct.pack("<iI", 1, 0) + bytes(100)
    records = [schema(1, SCAN)]
    for number in range(1, 2001):
        records += [channel(number, 1, f"/scan{number}"), message(number, data)]
    path = mcap(tmp_path / "topics.mcap", *records)
    with open_log(path) as log:
        assert len(log.streams) == 2000
