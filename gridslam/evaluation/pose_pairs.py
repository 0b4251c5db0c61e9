"""The poses of a result paired with those of the ground truth, and the alignment of the pairs."""

from __future__ import annotations

from gridslam.core.errors import InputError
from gridslam.core.stamps import format_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Alignment, find_alignment
from gridslam.evaluation.association import Pairs, associate
from gridslam.evaluation.inputs import EvaluationOptions


def aligned_pairs(
    estimate: Trajectory, truth: Trajectory, options: EvaluationOptions
) -> tuple[Pairs, Alignment]:
    """The paired poses, with those of the estimate aligned to the ground truth, and the alignment.

    Raises InputError: no poses can be paired, or the pairs do not determine the alignment.
    """
    pairs = pairs_of(estimate, truth, options)
    if not len(pairs):
        raise InputError(
            f"estimate ({_span(estimate)}) and truth ({_span(truth)}) have no stamps {options.nearness}; "
            f"a larger {options.nearness_option} pairs more"
        )
    alignment = find_alignment(pairs.estimate, pairs.truth, options.align, options.with_scale)
    if alignment is None:
        raise InputError(
            f"the {len(pairs)} paired positions do not determine an alignment (no motion, or none in common); "
            "use --align origin or --align none"
        )
    return Pairs(pairs.stamps_ns, alignment.apply(pairs.estimate), pairs.truth), alignment


def pairs_of(estimate: Trajectory, truth: Trajectory, options: EvaluationOptions) -> Pairs:
    """The paired poses, not aligned. The time offset of the options is added to the stamps of the estimate."""
    shifted = Trajectory(estimate.stamps_ns + options.time_offset_ns, estimate.poses)
    return associate(
        shifted.sorted(), truth.sorted(), options.sync, options.max_difference_ns, options.max_gap_ns
    )


def _span(trajectory: Trajectory) -> str:
    """Number of poses, first and last stamp, for an error message."""
    first, last = int(trajectory.stamps_ns.min()), int(trajectory.stamps_ns.max())
    return f"{len(trajectory)} poses, {format_stamp(first)} to {format_stamp(last)} s"
