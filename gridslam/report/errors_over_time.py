"""Errors of a run's trajectory over time, if the log has ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align, find_alignment
from gridslam.evaluation.association import Pairs, associate
from gridslam.evaluation.pose_errors import PoseErrors, absolute_errors
from gridslam.evaluation.statistics import Statistics, statistics
from gridslam.runs.run import Run

# Smallest error of a localization and largest fraction left after alignment if its map may have another frame than the truth
MIN_FRAME_ERROR_M, MAX_LEFT = 0.5, 0.2


@dataclass(frozen=True, slots=True)
class Errors:
    """Absolute pose errors at n > 0 stamps `(n,)`, and the kind of alignment that was applied.

    `aligned_rmse_m` is what a rigid alignment would leave of the root mean square error; None if it leaves most of it.
    """

    stamps_ns: NDArray[np.int64]
    ape: PoseErrors
    align: Align
    aligned_rmse_m: float | None = None

    def summary(self) -> dict[str, str | int | float | dict[str, Statistics] | None]:
        """Statistics for report.json, with the keys of `gridslam evaluate`."""
        ape = {"trans": statistics(self.ape.translation_m), "rot": statistics(self.ape.rotation_deg)}
        return {
            "align": self.align,
            "poses": len(self.stamps_ns),
            "ape": ape,
            "aligned_rmse_m": self.aligned_rmse_m,
        }


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
    ape = absolute_errors(alignment.apply(pairs.estimate), pairs.truth)
    return Errors(pairs.stamps_ns, ape, align, _aligned_rmse_m(pairs, ape) if align == "none" else None)


def _aligned_rmse_m(pairs: Pairs, ape: PoseErrors) -> float | None:
    """Root mean square error after a rigid alignment, if that takes away most of a large error."""
    rmse_m = float(np.sqrt(np.mean(ape.translation_m**2)))
    alignment = find_alignment(pairs.estimate, pairs.truth, "se2")
    if rmse_m < MIN_FRAME_ERROR_M or alignment is None:
        return None
    left_m = absolute_errors(alignment.apply(pairs.estimate), pairs.truth).translation_m
    aligned_m = float(np.sqrt(np.mean(left_m**2)))
    return aligned_m if aligned_m < MAX_LEFT * rmse_m else None
