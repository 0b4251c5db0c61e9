"""All remarks on one result: its files, its pairs with the ground truth, and the registration of its map."""

from __future__ import annotations

from typing import Any

from gridslam.core.errors import InputError
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.pose_pairs import pairs_of
from gridslam.evaluation.remarks.map_remarks import map_remarks
from gridslam.evaluation.remarks.pair_remarks import no_pairs_hint, pair_remarks
from gridslam.evaluation.remarks.series_remarks import series_remarks


def remarks_of(
    result: Result, truth: Truth, options: EvaluationOptions, document: dict[str, Any]
) -> list[str]:
    """Remarks on doubts about the measures of a document, one line each; often none."""
    remarks = [
        remark
        for series in (result.series, truth.series)
        if series is not None
        for remark in series_remarks(series)
    ]
    if result.trajectory is not None and truth.trajectory is not None:
        estimate = Trajectory(result.trajectory.stamps_ns + options.time_offset_ns, result.trajectory.poses)
        pairs = pairs_of(result.trajectory, truth.trajectory, options)
        remarks += pair_remarks(pairs, estimate, truth.trajectory, options.align, options.with_scale)
    elif result.occupancy is not None and truth.occupancy is not None:
        remarks += map_remarks(result.occupancy, truth.occupancy, document)
    return remarks


def check_pairs(result: Result, truth: Truth, options: EvaluationOptions) -> None:
    """Raise InputError, with the likely cause, if the trajectories have no stamps in common."""
    if result.series is None or truth.series is None:
        return
    assert result.trajectory is not None
    assert truth.trajectory is not None
    if len(pairs_of(result.trajectory, truth.trajectory, options)):
        return
    spans = [
        f"{series.name}: {len(series)} poses, {series.stamps_ns.min() / 1e9:.3f} to {series.stamps_ns.max() / 1e9:.3f} s"
        for series in (result.series, truth.series)
    ]
    hint = no_pairs_hint(result.series, truth.series, options.nearness_option)
    raise InputError(
        f"estimate ({spans[0]}) and truth ({spans[1]}) have no stamps {options.nearness}: {hint}"
    )
