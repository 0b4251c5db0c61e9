"""Remarks on an estimate against the ground truth: the likely cause of large errors, before anybody believes the numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align, find_alignment
from gridslam.evaluation.association import Pairs, associate
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.remarks.coverage_remarks import coverage_remarks
from gridslam.evaluation.time_offset import find_time_offset

Floats = NDArray[np.float64]
MIN_MOTION_M = 0.5  # shorter motions are too small to judge
CLEARLY_BETTER = 0.5  # a cause is named if its correction leaves less than this fraction of the error
# The same for a scale and a mirror image, which fit anything that is too large somewhere, or round
MAX_LEFT_BY_SHAPE = 0.2
MIN_GAIN_M = 0.05
MIN_OFFSET_M = 0.1
MIN_PAIRED = 0.8
SCALES = ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.3048, "feet"), (0.0254, "inches"))
# Smallest difference of a scale from 1 that is named, largest one from a unit's
MIN_SCALE, SCALE_TOLERANCE = 0.01, 0.05
LEVER_ROUNDS = 5  # number of times that alignment and lever are found in turn
MAX_LEVER_M = 5.0  # no point of a robot is farther from another
MIN_YAW_OFFSET_DEG, MAX_YAW_STD_DEG = 20.0, 10.0
# Largest error of an estimate that follows the truth, as a fraction of what is left if it had stayed in one place
MAX_LEFT_OF_MOTION = 0.7


def pair_remarks(
    pairs: Pairs, estimate: Trajectory, truth: Trajectory, align: Align, with_scale: bool = False
) -> Iterator[str]:
    """Remarks on an estimate against the ground truth: pairs, frame, scale, mirror image, clock, heading offset.

    `pairs` are not aligned; `align` and `with_scale` say how the measures align them.
    """
    fewer = min(len(estimate), len(truth))
    is_partial = len(pairs) < MIN_PAIRED * fewer
    if is_partial:
        between = len(associate(estimate.sorted(), truth.sorted(), "interpolate"))
        remedy = f"; --sync interpolate pairs {between}" if between > len(pairs) else ""
        yield (
            f"only {len(pairs)} of {fewer} poses are paired ({len(pairs) / fewer:.0%}); the others are not measured "
            f"(estimate {_span_s(estimate)}, truth {_span_s(truth)}){remedy}"
        )
    yield from coverage_remarks(pairs, truth)
    if len(pairs) < 3 or np.ptp(pairs.truth[:, :2], axis=0).max() < MIN_MOTION_M:
        return
    rigid = _rmse(pairs.estimate, pairs.truth)
    if align == "none" and not is_partial:
        yield from _frame_remarks(pairs, rigid)
    shape = list(_shape_remarks(pairs, rigid, with_scale))
    yield from shape
    if not shape:
        # A drive at constant speed looks alike with another clock and another point of the robot: the better one is named.
        causes = [*_clock_causes(estimate, truth, rigid), *_point_causes(pairs, rigid)]
        yield from (remark for _, remark in sorted(causes)[:1])
        if not causes:
            yield from _other_drive_remarks(pairs, rigid)
    yield from _heading_remarks(pairs)


def _frame_remarks(pairs: Pairs, rigid: float) -> Iterator[str]:
    """The trajectories have the same shape in different frames."""
    direct = float(np.sqrt((absolute_errors(pairs.estimate, pairs.truth).translation_m ** 2).mean()))
    if rigid < CLEARLY_BETTER**2 * direct and direct - rigid > MIN_OFFSET_M:
        found = find_alignment(pairs.estimate, pairs.truth, "se2")
        assert found is not None
        x, y, yaw = found.T_truth_estimate.tolist()
        yield (
            f"estimate and truth are in different frames: aligned by x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(yaw):.1f} deg "
            f"the error is {rigid:.3g} m instead of {direct:.3g} m; --align se2 does this"
        )


def _shape_remarks(pairs: Pairs, rigid: float, with_scale: bool) -> Iterator[str]:
    """The estimate is an inverted, mirrored or scaled copy of the truth."""
    for text, changed in (
        (
            "the poses of the estimate are inverted (the map in the robot's frame): inverted again",
            se2.inverse(pairs.estimate),
        ),
        ("the estimate is mirrored: with y negated", pairs.estimate * [1.0, -1.0, -1.0]),
    ):
        error = _rmse(changed, pairs.truth)
        if error < MAX_LEFT_BY_SHAPE * rigid and rigid - error > MIN_GAIN_M:
            yield f"{text} the error is {error:.3g} m instead of {rigid:.3g} m"
            return
    scaled = find_alignment(pairs.estimate, pairs.truth, "se2", with_scale=True)
    if scaled is None or abs(scaled.scale - 1.0) < MIN_SCALE:
        return
    error = float(
        np.sqrt((absolute_errors(scaled.apply(pairs.estimate), pairs.truth).translation_m ** 2).mean())
    )
    if error < MAX_LEFT_BY_SHAPE * rigid and rigid - error > MIN_GAIN_M:
        unit = next((u for s, u in SCALES if abs(scaled.scale / s - 1.0) < SCALE_TOLERANCE), "")
        inverse = next((u for s, u in SCALES if abs(scaled.scale * s - 1.0) < SCALE_TOLERANCE), "")
        cause = (
            f": is the estimate in {unit}?" if unit else f": is the truth in {inverse}?" if inverse else ";"
        )
        effect = "with --scale" if not with_scale else "after --scale"
        yield (
            f"the estimate is {1.0 / scaled.scale:.4g} times as large as the truth{cause} {effect} the error is {error:.3g} m"
            + ("" if with_scale else f" instead of {rigid:.3g} m")
        )


def _clock_causes(estimate: Trajectory, truth: Trajectory, rigid: float) -> Iterator[tuple[float, str]]:
    """The error (m) that is left if the clocks of estimate and truth differ, and a remark."""
    found = find_time_offset(estimate, truth)
    if found is not None and _is_clearly_better(found.rmse_m, rigid):
        yield (
            found.rmse_m,
            f"the estimate's clock differs: shifted by {found.offset_s:+.2f} s the error is {found.rmse_m:.3g} m instead of "
            f"{rigid:.3g} m; --time-offset {found.offset_s:.2f} does this",
        )


def _point_causes(pairs: Pairs, rigid: float) -> Iterator[tuple[float, str]]:
    """The error (m) that is left if estimate and truth are poses of two points of the robot, and a remark."""
    lever = np.zeros(3)
    for _ in range(LEVER_ROUNDS):
        found = find_alignment(se2.compose(pairs.estimate, lever), pairs.truth, "se2")
        if found is None:
            return
        aligned = found.apply(pairs.estimate)
        c, s = np.cos(aligned[:, 2]), np.sin(aligned[:, 2])
        # Ahead, left, and what the alignment changes by them: rotation, x, y
        rows = np.zeros((2, len(pairs), 5))
        rows[0] = np.stack([c, -s, -aligned[:, 1], np.ones_like(c), np.zeros_like(c)], axis=1)
        rows[1] = np.stack([s, c, aligned[:, 0], np.zeros_like(c), np.ones_like(c)], axis=1)
        off = (pairs.truth[:, :2] - aligned[:, :2]).T.ravel()
        lever[:2] = np.linalg.lstsq(rows.reshape(-1, 5), off, rcond=None)[0][:2]
    error = _rmse(se2.compose(pairs.estimate, lever), pairs.truth)
    if _is_clearly_better(error, rigid) and np.hypot(lever[0], lever[1]) < MAX_LEVER_M:
        yield (
            error,
            f"the truth seems to be of another point of the robot, {lever[0]:+.2f} m ahead and {lever[1]:+.2f} m to the left of "
            f"the estimate's: with it the error is {error:.3g} m instead of {rigid:.3g} m",
        )


def _other_drive_remarks(pairs: Pairs, rigid: float) -> Iterator[str]:
    """The estimate does not follow the truth."""
    standing = float(np.sqrt(np.var(pairs.truth[:, :2], axis=0).sum()))
    if rigid > MAX_LEFT_OF_MOTION * standing:
        yield (
            f"the estimate does not follow the truth: aligned the error is {rigid:.3g} m, and {standing:.3g} m if it had stayed "
            "in one place; are they of the same drive?"
        )


def _heading_remarks(pairs: Pairs) -> Iterator[str]:
    """The headings differ by a constant after alignment."""
    found = find_alignment(pairs.estimate, pairs.truth, "se2")
    if found is None:
        return
    off = pairs.truth[:, 2] - found.apply(pairs.estimate)[:, 2]
    mean = complex(np.cos(off).mean(), np.sin(off).mean())
    deviation = np.degrees(np.sqrt(max(-2.0 * np.log(max(abs(mean), 1e-9)), 0.0)))
    offset = np.degrees(np.angle(mean))
    if abs(offset) > MIN_YAW_OFFSET_DEG and deviation < MAX_YAW_STD_DEG:
        yield (
            f"the headings differ by a constant {offset:.0f} degrees although the positions agree: poses of a sensor, or another "
            "zero of the heading?"
        )
    elif deviation >= MAX_YAW_STD_DEG:
        turned = pairs.truth[:, 2] + found.apply(pairs.estimate)[:, 2]
        agreement = abs(complex(np.cos(turned).mean(), np.sin(turned).mean()))
        if np.degrees(np.sqrt(max(-2.0 * np.log(max(agreement, 1e-9)), 0.0))) < MAX_YAW_STD_DEG:
            yield "the headings agree with the sign reversed: yaw counts clockwise?"


def _rmse(estimate: Floats, truth: Floats) -> float:
    """Root mean square position error (m) after rigid alignment."""
    found = find_alignment(estimate, truth, "se2")
    aligned = estimate if found is None else se2.compose(found.T_truth_estimate, estimate)
    return float(np.sqrt((absolute_errors(aligned, truth).translation_m ** 2).mean()))


def _is_clearly_better(error: float, than: float) -> bool:
    return error < CLEARLY_BETTER * than and than - error > MIN_GAIN_M


def _span_s(trajectory: Trajectory) -> str:
    first, last = int(trajectory.stamps_ns.min()), int(trajectory.stamps_ns.max())
    return f"{first / 1e9:.1f} to {last / 1e9:.1f} s"


def no_pairs_hint(estimate: PoseSeries, truth: PoseSeries, option: str) -> str:
    """Advice for series without a stamp in common."""
    for series in (estimate, truth):
        if len(series) > 1 and (series.stamps_ns == series.stamps_ns[0]).all():
            return f"all stamps of {series.name} are the same"
    between = len(associate(estimate.trajectory.sorted(), truth.trajectory.sorted(), "interpolate"))
    if between:
        return f"--sync interpolate pairs {between}, and a larger {option} pairs more"
    first_e, first_t = int(estimate.stamps_ns.min()), int(truth.stamps_ns.min())
    last_e, last_t = int(estimate.stamps_ns.max()), int(truth.stamps_ns.max())
    if last_e < first_t or last_t < first_e:
        offset_s = (first_t - first_e) / 1e9
        zero = next((s.name for s in (estimate, truth) if int(s.stamps_ns.min()) < 1e9 * 86_400 * 365), None)
        cause = f"the stamps of {zero} count from another zero" if zero else "their times do not overlap"
        return f"{cause}; if both start together, use --time-offset {offset_s:.3f}"
    return f"a larger {option} pairs more"
