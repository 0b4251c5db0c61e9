"""Trials of localization in the simulated corridors: found or not, when, and how the particles drew together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.evaluation.association import associate
from gridslam.evaluation.localization import judge_localization
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.runs.run import Run, run_localize
from gridslam.runs.run_config import load_config
from tests.benchmarks.ispace_worlds import log_of

CONFIGS: Mapping[str, tuple[str, Sequence[str]]] = {
    "onboard": ("paper/ispace-mcl", ("method.cameras.enabled=false",)),
    "onboard-best": ("ispace-mcl", ("method.cameras.enabled=false",)),
    "paper": ("paper/ispace-mcl", ()),
    "fused": ("ispace-mcl", ()),
}
Z = 1.96  # normal quantile of 95 % intervals


@dataclass(frozen=True, slots=True)
class LocalizationTrial:
    """One run. `std_m` over `time_s` is the curve of figure 10; `worst_m` the largest error after the first good pose."""

    found: bool
    converged_s: float
    final_m: float
    worst_m: float
    time_s: NDArray[np.float64]
    std_m: NDArray[np.float64]
    timings_s: Mapping[str, float]
    updates: int


def trial(kind: str, number: int, config: str, seed: int, overrides: Iterable[str] = ()) -> LocalizationTrial:
    """Localize along one simulated drive, from anywhere."""
    log = log_of(kind, number)
    name, settings = CONFIGS[config]
    run = run_localize(
        load_config(name, [*settings, *overrides], seed),
        log,
        log.with_suffix(".truth") / "map.yaml",
        lambda progress: None,
        lambda: False,
    )
    return judged(run, log)


def judged(run: Run, log: Path) -> LocalizationTrial:
    """The trial of a finished run."""
    assert run.truth is not None, f"{log} has no truth"
    found = run.result.trajectory
    pairs = associate(found, run.truth, sync="interpolate")
    errors = absolute_errors(pairs.estimate, pairs.truth)
    start = int(found.stamps_ns[0])
    judgement = judge_localization(pairs.stamps_ns, errors, start)
    good = np.flatnonzero((errors.translation_m < 0.5) & (errors.rotation_deg < 10.0))
    std = run.result.series["particle_std_all"]
    return LocalizationTrial(
        judgement.success,
        judgement.time_to_convergence_s,
        float(errors.translation_m[-1]),
        float(errors.translation_m[good[0] :].max()) if len(good) else float("nan"),
        (std.stamps_ns - start) * 1e-9,
        std.values,
        run.result.timings_s,
        run.result.counters.get("updates", 0),
    )


def interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate."""
    rate, n = successes / trials, trials
    middle = (rate + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z / (1 + Z * Z / n) * sqrt(rate * (1 - rate) / n + Z * Z / (4 * n * n))
    return middle - half, middle + half
