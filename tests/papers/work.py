"""Sweeps and values for a section, each computed once per version of the program."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.files import write_atomic
from gridslam.report.document import json_bytes
from gridslam.sweep.config import SweepConfig, load_sweep
from gridslam.sweep.contents import content_key, program_key
from gridslam.sweep.local import run_locally
from gridslam.sweep.sweep import SweepResult, run_sweep
from tests.benchmarks.harness import say
from tests.conftest import REPOSITORY

SWEEPS = REPOSITORY / "configs" / "sweeps"


@dataclass(frozen=True, slots=True)
class Work:
    """Folder of finished work, number of processes, and largest number of seeds (None: all seeds of the page)."""

    folder: Path
    jobs: int = 1
    max_seeds: int | None = None

    def seeds(self, seeds: Sequence[int]) -> tuple[int, ...]:
        """The first `max_seeds` of them."""
        return tuple(seeds)[: self.max_seeds]

    def sweep(self, file: str, changes: dict[str, Any] | None = None, part: str = "") -> Found:
        """Run a sweep of configs/sweeps as `gridslam sweep` does, with changes to its file."""
        return self.run(load_sweep(SWEEPS / f"{file}.yaml"), SWEEPS, changes or {}, part or file)

    def run(self, sweep: SweepConfig, base: Path, changes: dict[str, Any], part: str) -> Found:
        """Run a sweep whose paths are relative to `base`. Failed gates are printed; a failed run raises RuntimeError."""
        document = sweep.model_dump() | changes
        document["seeds"] = list(self.seeds(document["seeds"]))
        chosen = SweepConfig.model_validate(document)
        run = partial(run_locally, processes=self.jobs, stop=lambda: False)
        folder = self.folder / part
        result = run_sweep(chosen, base, folder, run, lambda line: say(f"  {part}: {line}"), lambda: False)
        for line in result.failed_gates:
            say(f"  {part}: gate failed: {line}")
        if result.failed:
            raise RuntimeError(f"{result.failed[0].label}: {result.failed[0].result.error}")
        return Found(result, folder, chosen.seeds)

    def each(self, name: str, compute: Callable[[int], Any], seeds: Sequence[int]) -> list[Any]:
        """`compute(seed)` for every seed, as plain JSON values; known values of this program version are read back."""
        folder = self.folder / name
        folder.mkdir(parents=True, exist_ok=True)
        found = {seed: _known(folder, name, seed) for seed in self.seeds(seeds)}
        missing = [seed for seed, value in found.items() if value is None]
        for seed, value in zip(missing, self._computed(compute, missing), strict=True):
            say(f"  {name}: seed {seed}")
            key = content_key(program=program_key(), name=name, seed=seed)
            write_atomic(folder / f"{seed}.json", json_bytes({"key": key, "value": value}))
            found[seed] = value
        return [found[seed] for seed in self.seeds(seeds)]

    def _computed(self, compute: Callable[[int], Any], seeds: Sequence[int]) -> Iterator[Any]:
        if self.jobs == 1 or len(seeds) < 2:
            yield from map(compute, seeds)
            return
        with ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn")) as pool:
            yield from pool.map(compute, seeds)


@dataclass(frozen=True, slots=True)
class Found:
    """The result of a sweep."""

    result: SweepResult
    folder: Path
    seeds: tuple[int, ...]

    def values(self, key: str, log: str, config: str, override: str = "default") -> NDArray[np.float64]:
        """A measure of every seed of one log, config and override. Raises KeyError: the sweep has no such runs."""
        rows = [r for r in self.result.rows if (r.log, r.config, r.override) == (log, config, override)]
        if not rows:
            raise KeyError(f"{log} {config} {override}")
        return np.array([float(row.measures[key] or 0.0) for row in rows])

    def mean(self, key: str, log: str, config: str, override: str = "default") -> float:
        """The mean over the seeds."""
        return float(self.values(key, log, config, override).mean())

    def directory(self, log: str, config: str, override: str, seed: int) -> Path:
        """A run directory."""
        return self.folder / "runs" / log / config / override / f"seed-{seed}"

    def cpu_s(self, log: str, config: str, override: str = "default") -> float:
        """Mean processor time (s) of the runs."""
        rows = [r for r in self.result.rows if (r.log, r.config, r.override) == (log, config, override)]
        return float(np.mean([row.result.cost["cpu_s"] for row in rows]))


def _known(folder: Path, name: str, seed: int) -> Any:
    try:
        document = json.loads((folder / f"{seed}.json").read_bytes())
    except (OSError, ValueError):
        return None
    key = content_key(program=program_key(), name=name, seed=seed)
    return document["value"] if document.get("key") == key else None


def picture_of(path: Path, max_px: int = 1000) -> NDArray[np.uint8]:
    """A PNG as RGB `(h, w, 3)`, at most `max_px` wide."""
    with Image.open(path) as image:
        rgb = image.convert("RGB")
        if rgb.width > max_px:
            size = (max_px, round(rgb.height * max_px / rgb.width))
            rgb = rgb.resize(size, Image.Resampling.LANCZOS)
        return np.asarray(rgb)


def seeds_text(seeds: Sequence[int]) -> str:
    """The range of seeds as text, for example `0 to 9`."""
    return f"{min(seeds)} to {max(seeds)}" if len(seeds) > 1 else str(seeds[0])


def both(value: Callable[[str], object]) -> tuple[object, object]:
    """The values for the configs `paper` and `best`."""
    return value("paper"), value("best")
