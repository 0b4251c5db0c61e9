"""Remarks on trajectories that look wrong: the likely cause of large errors, before anybody believes the numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align, find_alignment
from gridslam.evaluation.association import Pairs, associate
from gridslam.evaluation.coverage_remarks import coverage_remarks
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.evaluation.pose_series import PoseSeries
from gridslam.evaluation.time_offset import find_time_offset

Floats = NDArray[np.float64]
TILTED_DEG, LEVEL_DEG = 20.0, 5.0  # median tilt of a series that is not planar, and of one that is
MIN_MOTION_M = 0.5  # shorter motions are too small to judge
OUT_OF_PLANE = 0.3  # vertical extent as a fraction of the horizontal one
MAX_YAW_RAD = 2.0 * np.pi + 0.1  # larger yaw angles are taken for degrees
CLEARLY_BETTER = 0.5  # a cause is named if its correction leaves less than this fraction of the error
MAX_LEFT_BY_SCALE = 0.2  # the same for a scale, which fits anything that is too large somewhere
MIN_GAIN_M = 0.05
MIN_OFFSET_M = 0.1
MIN_PAIRED = 0.8
MAX_REPEATED = 0.05  # largest fraction of repeated stamps of a series
SCALES = ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.3048, "feet"), (0.0254, "inches"))
SCALE_TOLERANCE = 0.05
MIN_YAW_OFFSET_DEG, MAX_YAW_STD_DEG = 20.0, 10.0


def series_remarks(series: PoseSeries) -> Iterator[str]:
    """Remarks on one series of poses alone."""
    yield from (f"{series.name}: {note}" for note in series.notes)
    if len(series) > 1 and series.has_stamps and (series.stamps_ns == series.stamps_ns[0]).all():
        yield f"{series.name}: all {len(series)} poses have the same stamp, and only the first one is used"
    elif series.has_stamps and (
        repeated := len(series) - len(np.unique(series.stamps_ns))
    ) > MAX_REPEATED * len(series):
        yield f"{series.name}: {repeated} of {len(series)} poses repeat a stamp and are not used"
    yield from _orientation_remarks(series)
    extent = np.ptp(series.positions_m, axis=0) if len(series) else np.zeros(3)
    horizontal = float(np.hypot(extent[0], extent[1]))
    if extent[2] > MIN_MOTION_M and extent[2] > OUT_OF_PLANE * horizontal:
        hint = ""
        if extent[1] < OUT_OF_PLANE * max(extent[0], extent[2]):
            hint = " (a camera frame: x right, y down, z forward?)"
        yield (
            f"{series.name}: the motion leaves the plane: {extent[2]:.1f} m along z, {extent[0]:.1f} m along x, "
            f"{extent[1]:.1f} m along y{hint}; z is ignored"
        )


def _orientation_remarks(series: PoseSeries) -> Iterator[str]:
    if series.quat_wxyz is not None:
        tilt, tilt_w_first = _median_tilt(series.quat_wxyz), _median_tilt(_read_w_first(series.quat_wxyz))
        if tilt > TILTED_DEG and tilt_w_first < LEVEL_DEG:
            yield (
                f"{series.name}: the orientations are tilted by {tilt:.0f} degrees, but level if the quaternions are "
                "written w first (qw qx qy qz): heading errors are wrong"
            )
            return
    elif series.yaw is not None and len(series) and np.ptp(series.yaw) > 0 and _looks_like_degrees(series):
        yield f"{series.name}: yaw goes up to {np.abs(series.yaw).max():.0f}: degrees? Radians are expected"
    yaw = series.trajectory.poses[:, 2]
    moves = len(series) > 2 and np.ptp(series.positions_m[:, :2], axis=0).max() > MIN_MOTION_M
    if moves and np.ptp(yaw) < 1e-6 and _turns(series.positions_m[:, :2]):
        yield f"{series.name}: the heading is the same in all poses although the path turns: no orientation was recorded?"


def _looks_like_degrees(series: PoseSeries) -> bool:
    """Yaw beyond a full turn that jumps back (unwrapped radians also exceed a turn, but do not jump)."""
    assert series.yaw is not None
    if np.abs(series.yaw).max() <= MAX_YAW_RAD:
        return False
    steps = np.diff(series.positions_m[:, :2], axis=0)
    moving = np.hypot(steps[:, 0], steps[:, 1]) > 1e-3
    if np.count_nonzero(moving) < 3:
        return True
    course = np.arctan2(steps[moving, 1], steps[moving, 0])

    def deviation(yaw: Floats) -> float:
        off = yaw[:-1][moving] - course
        return float(1.0 - np.hypot(np.cos(off).mean(), np.sin(off).mean()))

    return deviation(np.radians(series.yaw)) < deviation(series.yaw)


def _turns(positions: Floats) -> bool:
    """Whether the course of a path changes by more than 45 degrees."""
    steps = np.diff(positions, axis=0)
    steps = steps[np.hypot(steps[:, 0], steps[:, 1]) > 1e-3]
    if len(steps) < 3:
        return False
    course = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return bool(np.ptp(course) > np.pi / 4)


def _median_tilt(quat_wxyz: Floats) -> float:
    """Median angle (deg) between the z axis of the poses and the vertical."""
    up = 1.0 - 2.0 * (quat_wxyz[:, 1] ** 2 + quat_wxyz[:, 2] ** 2)
    return float(np.degrees(np.median(np.arccos(np.clip(up, -1.0, 1.0)))))


def _read_w_first(quat_wxyz: Floats) -> Floats:
    """The quaternions whose components stand in the file in the order w, x, y, z instead of x, y, z, w."""
    w, x, y, z = quat_wxyz.T
    return np.column_stack([x, y, z, w])


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
        yield from _clock_remarks(pairs, estimate, truth, rigid)
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
    """The estimate is a scaled or mirrored copy of the truth."""
    mirrored = pairs.estimate * [1.0, -1.0, -1.0]
    if _is_clearly_better(_rmse(mirrored, pairs.truth), rigid):
        yield (
            f"the estimate is mirrored: with y negated the error is {_rmse(mirrored, pairs.truth):.3g} m instead of {rigid:.3g} m"
        )
        return
    scaled = find_alignment(pairs.estimate, pairs.truth, "se2", with_scale=True)
    if scaled is None or abs(scaled.scale - 1.0) < SCALE_TOLERANCE:
        return
    error = float(
        np.sqrt((absolute_errors(scaled.apply(pairs.estimate), pairs.truth).translation_m ** 2).mean())
    )
    if error < MAX_LEFT_BY_SCALE * rigid and rigid - error > MIN_GAIN_M:
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


def _clock_remarks(pairs: Pairs, estimate: Trajectory, truth: Trajectory, rigid: float) -> Iterator[str]:
    """The clocks of estimate and truth differ."""
    found = find_time_offset(estimate, truth)
    if found is not None and _is_clearly_better(found.rmse_m, rigid):
        yield (
            f"the estimate's clock differs: shifted by {found.offset_s:+.2f} s the error is {found.rmse_m:.3g} m instead of "
            f"{rigid:.3g} m; --time-offset {found.offset_s:.2f} does this"
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
        if np.degrees(np.sqrt(-2.0 * np.log(max(agreement, 1e-9)))) < MAX_YAW_STD_DEG:
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
    first_e, first_t = int(estimate.stamps_ns.min()), int(truth.stamps_ns.min())
    last_e, last_t = int(estimate.stamps_ns.max()), int(truth.stamps_ns.max())
    if last_e < first_t or last_t < first_e:
        offset_s = (first_t - first_e) / 1e9
        zero = next((s.name for s in (estimate, truth) if int(s.stamps_ns.min()) < 1e9 * 86_400 * 365), None)
        cause = f"the stamps of {zero} count from another zero" if zero else "their times do not overlap"
        return f"{cause}; if both start together, use --time-offset {offset_s:.3f}"
    return f"a larger {option} pairs more"
