"""Sample logs, ways to damage them, and what must hold when a damaged log is read."""

from __future__ import annotations

import random
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from gridslam.core.errors import GridslamError
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.logs import open_log
from gridslam.logs.mcap.writer import McapWriter
from gridslam.logs.write import open_writer

SCANS = 100
BEAMS = 360
SECONDS = 10  # longest time that reading one of these small logs may take
WAITS = 20


def sample_events(scans: int = SCANS, beams: int = BEAMS, seed: int = 0) -> Iterator[Event]:
    """The extrinsics of a lidar, then odometry and a scan ten times a second."""
    random_numbers = np.random.default_rng(seed)
    start_ns = 1_700_000_000_123_456_789
    yield Transform(start_ns, "base_link", "laser", (0.2, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0), is_static=True)
    for i in range(scans):
        stamp_ns = start_ns + i * 100_000_000
        yield Odometry(stamp_ns, "odom", 0.05 * i, 0.0, 0.01 * i, 0.5, 0.1)
        ranges = random_numbers.uniform(0.5, 9.0, beams).astype(np.float32)
        yield LaserScan(stamp_ns + 7, "laser", ranges, -3.125, 0.0174560546875, 0.125, 30.0)


def sample_mcap(path: Path, compression: str = "zstd", chunk_bytes: int = 8000) -> Path:
    """About 200 kB in chunks of a few messages."""
    with McapWriter(path, compression, chunk_bytes) as writer:  # type: ignore[arg-type]
        for event in sample_events():
            writer.write(event)
    return path


def sample_csv(path: Path) -> Path:
    """The same as a folder."""
    with open_writer(path) as writer:
        for event in sample_events(20, 12):
            writer.write(event)
    return path


def sample_carmen(lines: int = 30, beams: int = 12) -> bytes:
    """A CARMEN log of FLASER, ROBOTLASER1 and ODOM lines."""
    random_numbers = random.Random(1)
    text = ["# a log", "PARAM robot_frontlaser_offset 0.1 nohost 0"]
    for i in range(lines):
        ranges = " ".join(f"{random_numbers.uniform(1, 9):.2f}" for _ in range(beams))
        pose, time = f"{i * 0.1:.6f} 0.000000 {i * 0.01:.6f}", f"{100 + i * 0.1:.6f} host {i * 0.1:.6f}"
        text.append(f"ODOM {pose} 0.1 0.0 0.0 {time}")
        if i % 3:
            text.append(f"FLASER {beams} {ranges} {pose} {pose} {time}")
        else:
            head = f"0 -1.570796 3.141593 0.285599 81.83 0.010000 0 {beams}"
            text.append(f"ROBOTLASER1 {head} {ranges} 0 {pose} {pose} 0.1 0.0 0.5 0.5 1.0 {time}")
    return ("\n".join(text) + "\n").encode()


def fingerprint(event: Event) -> bytes:
    """Equal for equal events and only for these: arrays with type and shape, floats to the last digit."""
    parts: list[object] = [type(event).__name__]
    for field in (f for f in fields(event) if f.compare):
        value = getattr(event, field.name)
        array = isinstance(value, np.ndarray)
        parts.append((value.dtype.str, value.shape, value.tobytes()) if array else value)
    return repr(parts).encode()


@dataclass(frozen=True, slots=True)
class LogReading:
    """Result of reading a log: fingerprints of its events other than transforms, or the error that refused it."""

    events: Counter[bytes]
    scans: int
    counters: dict[str, int]
    is_lossy: bool
    error: GridslamError | None


def read(path: Path) -> LogReading:
    """Read all of a log. Only a GridslamError of one line may come out, and that within seconds."""
    with limit(SECONDS):
        try:
            with open_log(path) as log:
                events = [e for e in log.events() if not isinstance(e, Transform)]
                scans = sum(isinstance(event, LaserScan) for event in events)
                prints = Counter(fingerprint(event) for event in events)
                assert len(log.problems) < 50
                return LogReading(prints, scans, log.counters, log.is_lossy, None)
        except GridslamError as error:
            assert error.exit_code in (2, 3)
            assert str(error)
            return LogReading(Counter(), 0, {}, True, error)


def whole_chunk_messages(data: bytes, cut: int) -> int:
    """Messages in the chunks that end before the cut, as the mcap library counts them."""
    import io

    position, total = 0, 0
    stream = io.BytesIO(data)
    for record in StreamReader(stream, emit_chunks=True).records:
        position = stream.tell()
        if position > cut:
            break
        if isinstance(record, Chunk):
            total += sum(isinstance(inner, Message) for inner in breakup_chunk(record))
    return total


@contextmanager
def limit(seconds: float) -> Iterator[None]:
    """TimeoutError when the block takes more CPU time, or waits for WAITS times as long: other processes may run as well."""

    def stop(number: int, frame: object) -> None:
        raise TimeoutError(f"took more than {seconds} s")

    timers = {signal.ITIMER_PROF: (signal.SIGPROF, 1), signal.ITIMER_REAL: (signal.SIGALRM, WAITS)}
    before = {number: signal.signal(number, stop) for number, _ in timers.values()}
    for timer, (_, factor) in timers.items():
        signal.setitimer(timer, factor * seconds)
    try:
        yield
    finally:
        for timer in timers:
            signal.setitimer(timer, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


Mutation = Callable[[bytes, random.Random], bytes]
_NUMBERS = [
    b"nan",
    b"inf",
    b"-1",
    b"1e999",
    b"0x10",
    b"",
    b"9" * 400,
    b"\xff\xfe",
    b"-0.0",
    b'"',
    b"1_0",
    b"2147483648",
]


def flip_byte(data: bytes, random_numbers: random.Random) -> bytes:
    """One byte changed."""
    place = random_numbers.randrange(len(data))
    changed = data[place] ^ random_numbers.randrange(1, 256)
    return data[:place] + bytes([changed]) + data[place + 1 :]


def cut(data: bytes, random_numbers: random.Random) -> bytes:
    """The beginning only."""
    return data[: random_numbers.randrange(len(data))]


def replace_word(data: bytes, random_numbers: random.Random) -> bytes:
    """One word or field replaced by something strange."""
    separator = random_numbers.choice([b",", b" ", b"\n"])
    words = data.split(separator)
    words[random_numbers.randrange(len(words))] = random_numbers.choice(_NUMBERS)
    return separator.join(words)


def move_line(data: bytes, random_numbers: random.Random) -> bytes:
    """Lines dropped, doubled or moved."""
    lines = data.split(b"\n")
    line = lines.pop(random_numbers.randrange(len(lines)))
    for _ in range(random_numbers.randrange(3)):
        lines.insert(random_numbers.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def insert_noise(data: bytes, random_numbers: random.Random) -> bytes:
    """Random bytes in between."""
    place = random_numbers.randrange(len(data))
    return data[:place] + random_numbers.randbytes(random_numbers.randrange(1, 60)) + data[place:]


TEXT_MUTATIONS: tuple[Mutation, ...] = (flip_byte, cut, replace_word, move_line, insert_noise)


def mutate_text(data: bytes, random_numbers: random.Random) -> bytes:
    """One to three mutations, one after the other."""
    for _ in range(random_numbers.randrange(1, 4)):
        if data:
            data = random_numbers.choice(TEXT_MUTATIONS)(data, random_numbers)
    return data
