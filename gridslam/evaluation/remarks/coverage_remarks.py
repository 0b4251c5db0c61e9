"""Remarks on what of the true path an estimate covers: a part of it, one place only, or with a jump in between."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.association import Pairs

MIN_COVERED = 0.8  # fraction of the true path's duration that an estimate should cover
MIN_TRUE_EXTENT_M = 1.0  # smallest extent of a path that is more than standing
MAX_STANDING_RATIO = 0.02  # largest ratio of the estimate's extent to the true one, where the estimate stands
# Excess of a jump over the true step: in m, and relative to the 99th percentile of all steps
MIN_JUMP_M, JUMP_RATIO = 1.0, 10.0


def coverage_remarks(pairs: Pairs, truth: Trajectory) -> Iterator[str]:
    """Remarks on pairs that are not aligned, and the whole true path."""
    if len(pairs) < 2:
        return
    covered_s = float(np.ptp(pairs.stamps_ns)) * 1e-9
    whole_s = float(np.ptp(truth.stamps_ns)) * 1e-9
    if covered_s < MIN_COVERED * whole_s:
        yield (
            f"the estimate covers {covered_s:.1f} of the {whole_s:.1f} s of the true path ({covered_s / whole_s:.0%}); "
            "the rest is not measured"
        )
    extent_m, true_m = (float(np.ptp(path[:, :2], axis=0).max()) for path in (pairs.estimate, pairs.truth))
    if true_m > MIN_TRUE_EXTENT_M and extent_m < MAX_STANDING_RATIO * true_m:
        yield f"the estimate stands still while the true path extends over {true_m:.1f} m"
    steps, true_steps = (np.hypot(*np.diff(path[:, :2], axis=0).T) for path in (pairs.estimate, pairs.truth))
    beyond = steps - true_steps
    jumps = beyond > max(MIN_JUMP_M, JUMP_RATIO * float(np.quantile(steps, 0.99)))
    if jumps.any():
        at = int(np.argmax(beyond))
        yield (
            f"the estimate jumps: by {steps[at]:.1f} m at {format_stamp(int(pairs.stamps_ns[at + 1]))} s while the truth moves "
            f"{true_steps[at]:.2f} m{'' if jumps.sum() == 1 else f', and {jumps.sum() - 1} more times'}"
        )
