"""Global localization among people in a corridor that looks the same everywhere, with and without fixed cameras.

Each drive is another world (start, route, people, noise); seeds are those of the filter. Ten worlds of each kind are run once,
with the configs that have bounds. With GRIDSLAM_ISPACE_SEEDS=5 in the environment all 100 trials of 20 worlds are run with all
configs, as the table of docs/ispace-mcl.md has them. The kind `covered` has cameras that cover the whole corridor, as in the
paper; in the others parts of it are in no camera's view.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.ispace_figure import draw_std
from tests.benchmarks.ispace_trials import LocalizationTrial, interval, trial
from tests.conftest import REPOSITORY

SEEDS = int(os.environ.get("GRIDSLAM_ISPACE_SEEDS", "0"))  # 0: the short table
SHORT_WORLDS, SHORT_CONFIGS = 10, ("paper", "fused")
FIGURE = REPOSITORY / "out" / "benchmarks" / "ispace-std.png"
# Kind of world, number of worlds, configs.
TABLE: Sequence[tuple[str, int, Sequence[str]]] = (
    ("covered", 20, ("onboard", "paper", "fused")),
    ("walking", 20, ("onboard", "onboard-best", "fused")),
    ("blind", 20, ("fused",)),
    ("standing", 10, ("fused",)),
    ("beside", 10, ("fused",)),
    ("mirrored", 10, ("fused",)),
)


def rows() -> Iterator[BenchmarkRow]:
    """Success rates with their intervals, median times to convergence, and the picture of the standard deviations."""
    curves: dict[str, Sequence[LocalizationTrial]] = {}
    for kind, worlds, configs in TABLE:
        count = worlds if SEEDS else SHORT_WORLDS
        for config in configs if SEEDS else [name for name in configs if name in SHORT_CONFIGS]:
            trials = [
                trial(kind, number, config, seed) for number in range(count) for seed in range(SEEDS or 1)
            ]
            if kind == "covered":
                curves[config] = trials
            yield from summary(f"ispace.{kind}.{config}", trials)
    if SEEDS:
        draw_std(curves, FIGURE)
        say(f"standard deviation of the particles over time: {FIGURE}")


def summary(name: str, trials: Sequence[LocalizationTrial]) -> Iterator[BenchmarkRow]:
    """Success, time to convergence, and convergences that were lost again."""
    found = sum(t.found for t in trials)
    low, high = interval(found, len(trials))
    failed = [index for index, t in enumerate(trials) if not t.found]
    rate = f"{found} of {len(trials)} ({100 * low:.0f} to {100 * high:.0f} %)"
    say(f"{name}: {rate}; failed trials: {failed or 'none'}")
    yield BenchmarkRow(f"{name}.found", 100.0 * found / len(trials), "%")
    yield BenchmarkRow(
        f"{name}.converged", float(np.median([t.converged_s for t in trials if t.found] or [np.nan])), "s"
    )
    for stage, cost in costs(trials).items():
        say(f"  {stage}: {cost:.2f} ms an update")


def costs(trials: Sequence[LocalizationTrial]) -> Mapping[str, float]:
    """Milliseconds of wall clock an update, by stage."""
    updates = sum(t.updates for t in trials)
    stages = trials[0].timings_s
    return {stage: 1e3 * sum(t.timings_s[stage] for t in trials) / updates for stage in stages}
