"""Message definitions made of the words of their languages in random order, and messages of what they define."""

from __future__ import annotations

import random
from pathlib import Path

from gridslam.logs.ros import protobuf
from gridslam.logs.ros.container import Schema
from gridslam.logs.ros.decoder import DECODING_ERRORS
from gridslam.logs.ros.ros1 import Ros1Types
from gridslam.logs.ros.types import decoder_of

SCAN = "sensor_msgs/msg/LaserScan"
NAMES = (
    "a",
    "b",
    "self",
    "class",
    "__x",
    "header",
    "LaserScan",
    "q/E",
    "std_msgs/Header",
    "x" * 101,
    "\u00e9",
    "np",
    "A",
)
SIZES = ("", "", "", "[]", "[]", "[0]", "[3]", "[<=2]", "[1000000]", "[-1]", "[[]]")
BASES = (
    "int8",
    "uint8",
    "float64",
    "string",
    "wstring",
    "time",
    "bool",
    "char",
    "byte",
    "string<=5",
    "float32",
)
VALUES = ("", "", "", "=3", " 5", '="x"', " [1, 2]", "=__import__('os')", ' "\\', "#", "@optional")
SEPARATORS = (
    "=" * 80 + "\nMSG: q/E\n",
    "=" * 80 + "\nMSG: std_msgs/Header\n",
    "=" * 79 + "\n",
    "MSG: q/E\n",
    "\r",
    "\n",
    "\0",
)
WORDS = (
    "module", "struct", "typedef", "const", "enum", "sequence", "<", ">", "<<", "*", "{", "}", "{", "}", "(", ")", "[", "]", ";",
    ";", ";", ",", "::", "@unit", "=", '"x"', "'c'", "/*", "*/", "//", "\n", "#include", "long", "unsigned", "double", "string",
    "octet", "long a;", "struct B { long a; };", "3", "-1", "1e9", "a", "b", "q", "LaserScan", "sequence<long>", "@a(b=1)",
)  # fmt: skip


def _msg(rng: random.Random) -> str:
    lines = [
        f"{rng.choice((*BASES, *NAMES))}{rng.choice(SIZES)} {rng.choice(NAMES)}{rng.choice(VALUES)}\n"
        if rng.random() < 0.85
        else rng.choice(SEPARATORS)
        for _ in range(rng.choice((1, 3, 10)))
    ]
    return "".join(lines)


def _idl(rng: random.Random) -> str:
    inside = " ".join(rng.choice(WORDS) for _ in range(rng.choice((0, 3, 10, 40))))
    fields = " ".join(rng.choice(WORDS) for _ in range(rng.choice((0, 1, 5))))
    return (
        f"module sensor_msgs {{ module msg {{ {inside} struct LaserScan {{ long a; {fields} }}; }}; }};"
        if rng.random() < 0.7
        else inside
    )


def _bytes(rng: random.Random) -> bytes:
    """Few bytes: small numbers in a few places, as counts are."""
    return bytes(
        rng.choice((0, 0, 0, 1, 2, 255, 10, 18, rng.randrange(256)))
        for _ in range(rng.choice((0, 8, 60, 400)))
    )


def fuzz_definition(rng: random.Random, folder: Path) -> str:
    """A definition, and one message of its type: each is understood or not."""
    language = rng.choice(("ros2msg", "ros2idl", "ros1msg", "protobuf"))
    if language == "ros1msg":
        converted = Ros1Types([(SCAN, _msg(rng))]).to_cdr(_bytes(rng), SCAN)
        return f"{language} {'read' if converted else 'not'}"
    text = _idl(rng) if language == "ros2idl" else _msg(rng)
    try:
        if language == "protobuf":
            decode = protobuf.decoder_of(b"".join(_bytes(rng) for _ in range(3)), "")
        else:
            decode = decoder_of(Schema(SCAN, language, text.encode()), SCAN)
    except DECODING_ERRORS:
        return f"{language} refused"
    try:
        decode(rng.choice((b"\0\1\0\0", b"\0\0\0\0", b"")) + _bytes(rng))
    except DECODING_ERRORS:
        return f"{language} not"
    return f"{language} read"
