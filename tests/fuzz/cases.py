"""Inputs with known faults: `python -m tests.fuzz.cases FOLDER...` opens each under limits and prints what comes of it.

A configuration is checked, a world checked and recorded, a map loaded; a log is read and converted there and back, which must
keep every event. Each ends in a result or in a GridslamError of one line.
"""

from __future__ import annotations

import resource
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from gridslam.config.builtin import read_config
from gridslam.core.errors import GridslamError
from gridslam.core.messages import Event, Transform
from gridslam.logs.convert import convert_log
from gridslam.logs.open import open_log
from gridslam.maps.load import load_any_map
from gridslam.runs.run_config import validate_run_config
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import validate_world
from tests.logs.mutations import fingerprint

LONGEST_S, MAX_MB = 10.0, 1024  # CPU time; address space beyond that of the start


class OutOfLimits(BaseException):
    """An input took too much CPU time; no `except Exception` hides it."""


@contextmanager
def limits(seconds: float = LONGEST_S, megabytes: int = MAX_MB) -> Iterator[None]:
    """OutOfLimits after so much CPU time of the process, MemoryError beyond so much memory more than now."""

    def stop(number: int, frame: object) -> None:
        raise OutOfLimits(f"more than {seconds} s of CPU time")

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before, space = signal.signal(signal.SIGPROF, stop), resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (megabytes << 20), space[1]))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_AS, space)
        signal.signal(signal.SIGPROF, before)


def files_of(folder: Path) -> list[Path]:
    """The inputs of a folder: files that belong to another one are left out."""
    return [path for path in sorted(folder.iterdir()) if path.suffix not in (".png", ".db3-wal")]


def result_of(path: Path, scratch: Path) -> str:
    """What comes of an input, in a line."""
    path = path.resolve()
    try:
        if path.name.startswith("fz_cfg"):
            validate_run_config(read_config(str(path))[0], path.name)
            return "valid"
        if path.name.startswith("fz_world"):
            return recorded(path, scratch)
        if path.suffix == ".yaml" or path.name.startswith("fz_map"):
            grid = load_any_map(path / "map.yaml" if path.is_dir() else path)
            return f"map {grid.probability.shape}"
        return read_and_converted(path, scratch)
    except GridslamError as error:
        text = str(error).replace(f"{path}/", "").replace(str(path), path.name).replace(f"{scratch}/", "")
        assert text.strip(), "an error says something"
        assert text.isprintable(), "an error has one line without control characters"
        assert len(text) < 4000
        return f"{type(error).__name__}: {text}"


def recorded(path: Path, scratch: Path) -> str:
    """Record a world; what is written is read without a loss."""
    world = validate_world(read_config(str(path))[0], path.name)
    record_world(world, scratch, scratch / "world.mcap", force=True)
    events, counters = events_of(scratch / "world.mcap")
    assert not lost(counters), counters
    return f"recorded {len(events)}"


def events_of(path: Path) -> tuple[list[bytes], dict[str, int]]:
    """Fingerprints of all messages, and the counters."""
    with open_log(path) as log:
        events = [event for _, _, event in log.events_by_stream(with_truth=True)]
        assert len(log.problems) < 200
        assert all(len(line) < 1000 for line in log.problems)
        return [fingerprint(one_nan(event)) for event in events if not is_extrinsic(event)], log.counters


def is_extrinsic(event: Event) -> bool:
    """Extrinsics are not messages: a sensor without any is at the robot's centre."""
    return isinstance(event, Transform) and event.is_static


def one_nan(event: Event) -> Event:
    """The event with the same bits in every NaN: text has only one."""
    arrays = [
        f.name for f in fields(event) if getattr(getattr(event, f.name), "dtype", np.dtype(int)).kind == "f"
    ]
    return replace(
        event,
        **{n: np.where(np.isnan(a), a.dtype.type(np.nan), a) for n in arrays for a in [getattr(event, n)]},
    )


def lost(counters: dict[str, int]) -> int:
    """Messages and parts of files that were not used."""
    return sum(n for name, n in counters.items() if name.startswith(("skipped.", "lost.")))


def read_and_converted(path: Path, scratch: Path) -> str:
    """Read a log, and convert it to MCAP, CSV and MCAP: the events stay the same, and nothing more is lost.

    Only the first conversion may change the order among streams, where stamps are out of order, and name a nameless camera.
    """
    events, counters = events_of(path)
    if events:
        convert(path, scratch / "first.mcap")
        first, path = events_of(scratch / "first.mcap")[0], scratch / "first.mcap"
        assert Counter(map(unnamed, first)) == Counter(map(unnamed, events)), "the conversion changes events"
        for name in ("folder", "second.mcap"):
            convert(path, scratch / name)
            converted, after = events_of(scratch / name)
            assert converted == first, f"{name} has other events"
            assert not lost(after), after
            path = scratch / name
    return f"read {len(events)}, lost {lost(counters)}"


def convert(path: Path, output: Path) -> None:
    with open_log(path) as log:
        convert_log(log, output)


def unnamed(event: bytes) -> bytes:
    """The fingerprint without the name that a camera of no name gets."""
    return event.replace(b", 'camera'", b", ''")


def main(folders: list[str]) -> int:
    """Print what comes of every input; 1 if one is wrong."""
    wrong = 0
    for path in (path for folder in folders for path in files_of(Path(folder))):
        with tempfile.TemporaryDirectory() as scratch:
            try:
                with limits():
                    line = result_of(path, Path(scratch))
            except (Exception, OutOfLimits) as error:
                wrong += 1
                line = f"BUG {type(error).__name__}: {error}"
        sys.stdout.write(f"{path.name}: {line[:300]}\n")
        sys.stdout.flush()
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
