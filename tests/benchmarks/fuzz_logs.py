"""Damage logs in thousands of ways and read them: `python -m tests.benchmarks.fuzz_logs [COUNT]`.

Cuts and byte flips of an MCAP file of 200 kB in each compression, and mutated CSV folders and CARMEN logs.
In each case: no traceback, no hang, and what could be read is what was written. A sample goes through the
command line as well.
"""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.logs.mutations import (
    LogReading,
    flip_byte,
    mutate_text,
    read,
    sample_carmen,
    sample_csv,
    sample_mcap,
    whole_chunk_messages,
)

COMPRESSIONS = ("zstd", "lz4", "none")


def fuzz_cuts(folder: Path, count: int, seed: int = 1) -> Iterator[LogReading]:
    """MCAP files cut anywhere: the messages of the whole chunks before the cut, and the first ones of the cut chunk."""
    random_numbers = random.Random(seed)
    for compression in COMPRESSIONS:
        path = sample_mcap(folder / "whole.mcap", compression)
        whole, original = path.read_bytes(), read(path).events
        total = whole_chunk_messages(whole, len(whole)) - 1
        for _ in range(-(-count // len(COMPRESSIONS))):
            place = random_numbers.randrange(len(whole))
            path = folder / "cut.mcap"
            path.write_bytes(whole[:place])
            reading = read(path)
            expected = whole_chunk_messages(whole, place)
            got = sum(reading.events.values())
            expected = max(expected - 1, 0)  # the extrinsics is in the first chunk
            assert got >= expected or (reading.error and not expected), (compression, place, got, expected)
            assert reading.events <= original, (compression, place)
            assert reading.is_lossy or got == total, (compression, place)
            yield reading


def fuzz_flips(folder: Path, count: int, seed: int = 2) -> Iterator[LogReading]:
    """MCAP files with one byte changed: nothing false is played back, and at most one chunk's messages are missing
    without a word. A file whose beginning is damaged may be refused."""
    random_numbers = random.Random(seed)
    for compression in COMPRESSIONS:
        path = sample_mcap(folder / "whole.mcap", compression)
        whole, original = path.read_bytes(), read(path).events
        for _ in range(-(-count // len(COMPRESSIONS))):
            changed = flip_byte(whole, random_numbers)
            path = folder / "flipped.mcap"
            path.write_bytes(changed)
            reading = read(path)
            place = next(i for i, (a, b) in enumerate(zip(whole, changed, strict=True)) if a != b)
            if reading.error is None:
                assert not reading.events - original, (compression, place, "false events")
                missing = sum((original - reading.events).values())
                assert not missing or reading.is_lossy, (compression, place, missing, reading.counters)
                assert missing <= 20, (compression, place, missing, reading.counters)
            else:
                assert place < 8, (compression, place, str(reading.error))
            yield reading


def fuzz_csv(folder: Path, count: int, seed: int = 3) -> Iterator[LogReading]:
    """CSV folders with one file mutated, log.yaml among them."""
    random_numbers = random.Random(seed)
    whole = folder / "csv"
    shutil.rmtree(whole, ignore_errors=True)
    sample_csv(whole)
    names = sorted(p.name for p in whole.iterdir())
    for _ in range(count):
        name = random_numbers.choice(names)
        original = (whole / name).read_bytes()
        (whole / name).write_bytes(mutate_text(original, random_numbers))
        yield read(whole)
        (whole / name).write_bytes(original)


def fuzz_carmen(folder: Path, count: int, seed: int = 4) -> Iterator[LogReading]:
    """CARMEN logs with one to three mutations."""
    random_numbers = random.Random(seed)
    whole = sample_carmen()
    path = folder / "mutated.log"
    for _ in range(count):
        path.write_bytes(mutate_text(whole, random_numbers))
        yield read(path)


def fuzz_packed(folder: Path, count: int, seed: int = 5) -> Iterator[LogReading]:
    """Packed CARMEN logs, cut or with one byte changed."""
    import bz2
    import gzip

    random_numbers = random.Random(seed)
    path = folder / "mutated.log"
    for packed in (gzip.compress(sample_carmen(200), mtime=0), bz2.compress(sample_carmen(200))):
        for number in range(count // 2):
            place = random_numbers.randrange(len(packed))
            path.write_bytes(packed[:place] if number % 2 else flip_byte(packed, random_numbers))
            yield read(path)


FUZZERS = {
    "MCAP cut": fuzz_cuts,
    "MCAP flipped": fuzz_flips,
    "CSV mutated": fuzz_csv,
    "CARMEN mutated": fuzz_carmen,
    "packed CARMEN damaged": fuzz_packed,
}


def through_the_command_line(folder: Path, count: int) -> Counter[int]:
    """Exit codes of `gridslam info --strict` and `gridslam convert` on damaged logs."""
    random_numbers = random.Random(6)
    whole = sample_mcap(folder / "whole.mcap").read_bytes()
    codes: Counter[int] = Counter()
    for number in range(count):
        path = folder / "damaged.mcap"
        path.write_bytes(
            flip_byte(whole, random_numbers) if number % 2 else whole[: random_numbers.randrange(len(whole))]
        )
        expected = read(path)
        for command in (
            ["info", path, "--strict"],
            ["convert", path, folder / "out.mcap", "--force", "--strict"],
        ):
            done = subprocess.run(
                [sys.executable, "-c", "from gridslam.cli.main import run; run()", *map(str, command)],
                capture_output=True,
                text=True,
                timeout=60,
            )
            assert "Traceback" not in done.stderr, done.stderr
            assert done.returncode == (3 if expected.is_lossy else 0), (command, done.returncode, done.stderr)
            codes[done.returncode] += 1
    return codes


def main(count: int) -> None:
    """Run everything and print the results."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, fuzzer in FUZZERS.items():
            results: Counter[str] = Counter()
            for reading in fuzzer(folder, count):
                results["refused" if reading.error else "lossy" if reading.is_lossy else "whole"] += 1
            print(f"{title:24} {dict(sorted(results.items()))}", flush=True)  # noqa: T201
        codes = through_the_command_line(folder, max(count // 50, 2))
        print(f"{'command line':24} exit codes {dict(codes)}")  # noqa: T201


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
