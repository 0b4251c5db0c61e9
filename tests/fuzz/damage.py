"""How bytes and names of a log are damaged."""

from __future__ import annotations

import random
import struct

NUMBERS = ["nan", "inf", "-1", "0", "1e308", "-1e-320", "4294967296", "9223372036854775807", "", "x", "1_0"]
NAMES = [
    b"",
    b"\x1b[31m",
    b"a\nb",
    b"/ground_truth",
    b"left_wheel",
    b"\xff\xfe",
    "\u202e".encode(),
    b"x" * 300,
    b"base_link",
]


def changed(data: bytes, rng: random.Random) -> bytes:
    """A payload with a few bytes, words or names replaced, or cut, or longer."""
    body = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(body)) if body else 0
        what = rng.randrange(6)
        if what == 0 and body:
            body[at] = rng.randrange(256)
        elif what == 1:
            word = struct.pack(rng.choice(["<d", "<f", "<I", "<q"]), *[rng.choice((0, 1, 2**31 - 1))])
            body[at : at + len(word)] = word
        elif what == 2:
            body[at : at + 8] = struct.pack("<d", rng.choice((float("nan"), float("inf"), -1e300, 1e-320)))
        elif what == 3:
            body = body[:at]
        elif what == 4:
            name = rng.choice(NAMES)
            body[at : at + len(name) + 4] = struct.pack("<I", len(name) + 1) + name
        else:
            body[at:at] = rng.randbytes(rng.randrange(8))
    return bytes(body)
