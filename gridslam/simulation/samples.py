"""The sample logs: `python -m gridslam.simulation.samples FOLDER [NAME ...]` writes them, byte for byte the same each time."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import load_world


@dataclass(frozen=True, slots=True)
class Sample:
    """A log's name, the built-in world that it is made in, and what is changed there."""

    name: str
    world: str
    overrides: tuple[str, ...] = ()


SAMPLES = (Sample("slam-sd.mcap", "office"),)


def write_samples(folder: Path, names: Sequence[str] = ()) -> None:
    """Write all samples, or those named."""
    folder.mkdir(parents=True, exist_ok=True)
    for sample in SAMPLES:
        if not names or sample.name in names:
            world, path = load_world(sample.world, sample.overrides)
            record_world(world, path.parent, folder / sample.name, force=True)


if __name__ == "__main__":
    write_samples(Path(sys.argv[1]), sys.argv[2:])
