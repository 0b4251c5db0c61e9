"""Global localization in corridors of 30 to 100 m by seed, with two to eight people and cameras over 30 to 100 % of the floor.

Ten corridors; GRIDSLAM_ISPACE_CORRIDORS=100 in the environment runs as many as docs/ispace-mcl.md reports.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.ispace_corridor_trials import WRONG_FOR_S, summary, trial

CORRIDORS = int(os.environ.get("GRIDSLAM_ISPACE_CORRIDORS", "10"))


def rows() -> Iterator[BenchmarkRow]:
    """How many are found, the time from first being in view, and the corridors in which `localized` is said wrongly."""
    trials = [trial(seed, "fused") for seed in range(CORRIDORS)]
    summary("fused", trials)
    after = [t.after_view_s for t in trials if t.found]
    yield BenchmarkRow("ispace.corridors.found", 100.0 * len(after) / CORRIDORS, "%")
    yield BenchmarkRow("ispace.corridors.after_view.median", float(np.median(after)), "s")
    yield BenchmarkRow("ispace.corridors.after_view.90", float(np.percentile(after, 90)), "s")
    yield BenchmarkRow("ispace.corridors.wrong", sum(t.wrong_s > WRONG_FOR_S for t in trials), "corridors")
