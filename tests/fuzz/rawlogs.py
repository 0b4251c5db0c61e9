"""Damaged MRPT rawlogs: whole objects in odd orders and versions, and bytes that are exchanged, cut out or repeated."""

from __future__ import annotations

import gzip
import random
import struct
from pathlib import Path

from tests.rawlog_objects import action_of, frame_of, object_of, odometry_of, scan_of

S = 10**9
START_NS = 1_600_000_000 * S
ODD_NUMBERS = [
    b"\0\0\0\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\xc0\x7f",
    b"\x00\x00\x80\x7f",
]
ODD_DOUBLES = [struct.pack("<d", v) for v in (float("nan"), float("inf"), 1e300, -1e12, 0.0)]
LABELS = ["HOKUYO", "", "A\x1b[31mB", "a\nb", "x" * 300, "../../x", "odom"]


def fuzz_rawlog(target: Path, sample: Path, rng: random.Random) -> Path:
    """A log of a few objects, most of them whole."""
    objects = [_drawn(rng, START_NS + k * S // rng.choice([1, 10, 100])) for k in range(rng.randint(1, 12))]
    if rng.random() < 0.3:
        objects = [frame_of(*objects)]
    data = bytearray(b"".join(objects))
    for _ in range(rng.choice([0, 1, 1, 2, 5])):
        _damage(data, rng)
    target.write_bytes(gzip.compress(bytes(data), 1, mtime=0) if rng.random() < 0.2 else bytes(data))
    return target


def _drawn(rng: random.Random, stamp_ns: int) -> bytes:
    kind = rng.randrange(4)
    if kind == 0:
        return odometry_of(stamp_ns, rng.choice([0.1, 1e9, float("nan"), float("inf")]), rng.uniform(-9, 9))
    if kind == 1:
        return action_of(0.1, 0.2, rng.randint(4, 7), stamp_ns if rng.random() < 0.5 else 0)
    if kind == 2:
        return object_of(
            rng.choice(["CObservationImage", "CObservationGPS", "CPose2D"]), 3, rng.randbytes(20)
        )
    return scan_of(stamp_ns, rng.randint(4, 8), rng.choice(LABELS), rng.random() < 0.8)


def _damage(data: bytearray, rng: random.Random) -> None:
    """Change some bytes."""
    if not data:
        return
    at = rng.randrange(len(data))
    kind = rng.randrange(6)
    if kind == 0:
        data[at] = rng.randrange(256)
    elif kind == 1:
        data[at : at + 4] = rng.choice(ODD_NUMBERS)
    elif kind == 2:
        data[at : at + 8] = rng.choice(ODD_DOUBLES)
    elif kind == 3:
        del data[at : at + rng.randint(1, 60)]
    elif kind == 4:
        data[at:at] = data[max(0, at - rng.randint(1, 200)) : at]
    else:
        del data[at:]
