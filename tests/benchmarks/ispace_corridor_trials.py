"""Trials of localization in the corridors by seed: found or not, when, and how long it was wrong and called localized.

`python -m tests.benchmarks.ispace_corridor_trials CONFIG FIRST LAST` prints a line for every seed, and a summary.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import stretches
from gridslam.evaluation.association import associate
from gridslam.evaluation.localization import judge_localization
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.methods.base import RunResult
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.runs.run_config import load_config
from gridslam.simulation.world_config import WorldConfig
from tests.benchmarks.harness import say
from tests.benchmarks.ispace_corridors import is_in_view, world_of
from tests.benchmarks.ispace_trials import CONFIGS
from tests.benchmarks.seen_corridor import SeenDrive, drive_through

# A pose farther off must not be called localized, least of all for longer than this
WRONG_M, WRONG_FOR_S = 1.0, 2.0
CALIBRATED_M = 0.5  # a pose that is called localized should be nearer than this


@dataclass(frozen=True, slots=True)
class CorridorTrial:
    """One run. `after_view_s` is the time from first being in view until found, NaN if not found or never in view.

    `wrong_s` is the longest time that poses more than WRONG_M off were called localized. `localized` and `calibrated` count the
    poses that were called so, and those of them within CALIBRATED_M.
    """

    seed: int
    found: bool
    after_start_s: float
    after_view_s: float
    final_m: float
    wrong_s: float
    localized: int
    calibrated: int
    poses: int


def trial(seed: int, config: str, filter_seed: int = 0) -> CorridorTrial:
    """Localize along the drive of a seed, from anywhere."""
    world = world_of(seed)
    drive = drive_through(world)
    name, settings = CONFIGS[config]
    method_config = load_config(name, settings, filter_seed).method
    assert isinstance(method_config, IspaceMclConfig)
    method = IspaceMcl(method_config, filter_seed, drive.grid)
    method.cameras.fixed.update(drive.cameras)
    for event in drive.events:
        method.process(event)
    return judged(method.result(), drive, seed, world)


def judged(result: RunResult, drive: SeenDrive, seed: int, world: WorldConfig) -> CorridorTrial:
    """The trial of a finished run."""
    pairs = associate(result.trajectory, drive.truth, sync="interpolate")
    errors = absolute_errors(pairs.estimate, pairs.truth)
    start_ns = int(result.trajectory.stamps_ns[0])
    judgement = judge_localization(pairs.stamps_ns, errors, start_ns)
    in_view = is_in_view(world, pairs.truth[:, :2]).any(axis=0)
    seen_s = (int(pairs.stamps_ns[np.argmax(in_view)]) - start_ns) * 1e-9 if in_view.any() else np.nan
    is_localized = np.isin(pairs.stamps_ns, localized_ns(result))
    off_m = errors.translation_m
    return CorridorTrial(
        seed,
        judgement.success,
        judgement.time_to_convergence_s,
        max(judgement.time_to_convergence_s - seen_s, 0.0) if judgement.success else np.nan,
        float(off_m[-1]),
        longest_s(pairs.stamps_ns, is_localized & (off_m > WRONG_M)),
        int(is_localized.sum()),
        int((is_localized & (off_m < CALIBRATED_M)).sum()),
        len(off_m),
    )


def localized_ns(result: RunResult) -> NDArray[np.int64]:
    """The stamps of the poses that were called localized."""
    rows = result.tables["localization"].rows
    is_localized = np.array([row[-1] == "localized" for row in rows], np.bool_)
    return np.asarray(result.trajectory.stamps_ns[is_localized])


def longest_s(stamps_ns: NDArray[np.int64], mask: NDArray[np.bool_]) -> float:
    """The longest stretch of time over which the mask `(n,)` is True, s."""
    parts = stretches(stamps_ns, mask)
    return float((parts[:, 1] - parts[:, 0]).max() * 1e-9) if len(parts) else 0.0


def summary(config: str, trials: Sequence[CorridorTrial]) -> None:
    """Say how many were found and when, what was wrong, and how well `localized` is calibrated."""
    found = [t for t in trials if t.found]
    after = [t.after_view_s for t in found if np.isfinite(t.after_view_s)] or [np.nan]
    localized = sum(t.localized for t in trials)
    say(
        f"{config}: found {len(found)} of {len(trials)}, not from {[t.seed for t in trials if not t.found]}; "
        f"after first view: median {np.median(after):.1f} s, 90 % {np.percentile(after, 90):.1f} s, worst "
        f"{max(after):.1f} s; localized and wrong: worst {max(t.wrong_s for t in trials):.1f} s, over {WRONG_FOR_S:g} s in "
        f"{sum(t.wrong_s > WRONG_FOR_S for t in trials)}; localized {100 * localized / sum(t.poses for t in trials):.0f} %, of "
        f"these within {CALIBRATED_M} m {100 * sum(t.calibrated for t in trials) / max(localized, 1):.2f} %"
    )


def main(arguments: Sequence[str]) -> None:
    """Run the trials of some seeds."""
    config, first, last = arguments
    trials = []
    for seed in range(int(first), int(last) + 1):
        trials.append(trial(seed, config))
        t = trials[-1]
        say(
            f"{seed} {'found' if t.found else 'lost '} after {t.after_start_s:.1f} s, {t.after_view_s:.1f} s in view; "
            f"end {t.final_m:.2f} m; wrong {t.wrong_s:.1f} s; localized {t.localized} of {t.poses}, calibrated {t.calibrated}"
        )
    summary(config, trials)


if __name__ == "__main__":
    main(sys.argv[1:])
