"""Errors of a run's trajectory over time, if the log has ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align, find_alignment
from gridslam.evaluation.association import associate
from gridslam.evaluation.pose_errors import PoseErrors, absolute_errors
from gridslam.evaluation.statistics import Statistics, statistics
from gridslam.runs.run import Run


@dataclass(frozen=True, slots=True)
class Errors:
    """Absolute pose errors at n > 0 stamps `(n,)`, and the kind of alignment that was applied."""

    stamps_ns: NDArray[np.int64]
    ape: PoseErrors
    align: Align

    def summary(self) -> dict[str, str | int | dict[str, Statistics]]:
        """Statistics for report.json, with the keys of `gridslam evaluate`."""
        ape = {"trans": statistics(self.ape.translation_m), "rot": statistics(self.ape.rotation_deg)}
        return {"align": self.align, "poses": len(self.stamps_ns), "ape": ape}


def errors_of(run: Run) -> Errors | None:
    """Errors of a run against the ground truth in its log; None without ground truth at the times of the poses.

    The frame of a new map is arbitrary, so its trajectory is aligned (SE2). A localization on a given map is not.
    """
    if run.truth is None:
        return None
    return errors_over_time(run.result.trajectory, run.truth, "none" if run.command == "localize" else "se2")


def errors_over_time(estimate: Trajectory, truth: Trajectory, align: Align) -> Errors | None:
    """Errors of the poses that have ground truth; None if there are none, or too few to align."""
    pairs = associate(estimate.sorted(), truth.sorted())
    alignment = find_alignment(pairs.estimate, pairs.truth, align)
    if alignment is None or not len(pairs):
        return None
    return Errors(pairs.stamps_ns, absolute_errors(alignment.apply(pairs.estimate), pairs.truth), align)
