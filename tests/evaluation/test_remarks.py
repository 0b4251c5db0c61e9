"""Every usual mistake in trajectory files gets a remark that names its likely cause; a sound pair gets none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.errors import InputError
from gridslam.core.poses import compose, inverse, quaternion_of_yaw
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align
from gridslam.evaluation.document import evaluate
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.remarks.sanity import check_pairs, remarks_of

N = 200
TIME = 0.1 * np.arange(N)
START_NS = 1_311_875_572_000_000_000


def loop(noise_m: float = 0.0, name: str = "truth.tum") -> PoseSeries:
    """A figure of eight in the plane, with quaternions."""
    rng = np.random.default_rng(0)
    angle = 2.0 * np.pi * TIME / TIME[-1]
    x, y = 3.0 + 5.0 * np.cos(angle), 3.0 * np.sin(2.0 * angle)
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    positions = np.column_stack([x, y, np.zeros(N)]) + noise_m * rng.standard_normal((N, 3)) * [1, 1, 0]
    stamps = START_NS + np.round(TIME * 1e9).astype(np.int64)
    return PoseSeries(name, stamps, positions, quaternion_of_yaw(yaw))


TRUTH, ESTIMATE = loop(), loop(0.02, "est.tum")
W, X, Y, Z = ESTIMATE.quat_wxyz.T
YAW = ESTIMATE.trajectory.poses[:, 2]


def moved(pose: tuple[float, float, float]) -> PoseSeries:
    poses = compose(np.array(pose), ESTIMATE.trajectory.poses)
    return PoseSeries("est.tum", ESTIMATE.stamps_ns, np.pad(poses[:, :2], ((0, 0), (0, 1))), yaw=poses[:, 2])


def part(count: int) -> PoseSeries:
    """The first poses."""
    return PoseSeries(
        "est.tum", ESTIMATE.stamps_ns[:count], ESTIMATE.positions_m[:count], ESTIMATE.quat_wxyz[:count]
    )


def remarks(estimate: PoseSeries, align: Align = "none", truth: PoseSeries = TRUTH) -> list[str]:
    options = EvaluationOptions(align=align)
    result = Result(trajectory=estimate.trajectory, series=estimate)
    true = Truth(trajectory=truth.trajectory, series=truth)
    return remarks_of(result, true, options, evaluate(result, true, options))


@pytest.mark.parametrize("align", ["none", "se2"])
def test_the_truth_of_another_drive_is_doubted(align: Align) -> None:
    along = np.column_stack([np.zeros(N), 0.4 * TIME, np.zeros(N)])
    other = PoseSeries("other.tum", ESTIMATE.stamps_ns, along, quaternion_of_yaw(np.full(N, 1.57)))
    (remark,) = [r for r in remarks(other, align) if "same drive" in r]
    assert remark.startswith("the estimate does not follow the truth: aligned the error is 4.31 m")


@pytest.mark.parametrize("align", ["none", "se2", "origin"])
def test_a_sound_estimate_gets_no_remark(align: Align) -> None:
    assert remarks(ESTIMATE, align) == []


MISTAKES = {
    "w first": (replace(ESTIMATE, quat_wxyz=np.column_stack([Z, W, X, Y])), ["w first"]),
    "degrees": (replace(ESTIMATE, quat_wxyz=None, yaw=np.degrees(YAW)), ["degrees"]),
    "millimetres": (replace(ESTIMATE, positions_m=1000.0 * ESTIMATE.positions_m), ["millimetres"]),
    "feet": (replace(ESTIMATE, positions_m=ESTIMATE.positions_m / 0.3048), ["feet"]),
    "mirrored": (
        replace(ESTIMATE, positions_m=ESTIMATE.positions_m * [1, -1, 1], quat_wxyz=quaternion_of_yaw(-YAW)),
        ["mirrored"],
    ),
    "other clock": (replace(ESTIMATE, stamps_ns=ESTIMATE.stamps_ns + 2_000_000_000), ["--time-offset -2.00"]),
    "no heading": (replace(ESTIMATE, quat_wxyz=quaternion_of_yaw(np.zeros(N))), ["heading is the same"]),
    "out of the plane": (
        replace(
            ESTIMATE,
            positions_m=np.column_stack(
                [-ESTIMATE.positions_m[:, 1], np.zeros(N), ESTIMATE.positions_m[:, 0]]
            ),
        ),
        ["leaves the plane", "camera frame"],
    ),
    "unpaired": (
        replace(ESTIMATE, stamps_ns=ESTIMATE.stamps_ns + 15_000_000_000),
        ["only 50 of 200", "--time-offset -15.00"],
    ),
    "heading offset": (
        replace(ESTIMATE, quat_wxyz=quaternion_of_yaw(YAW + np.pi / 2)),
        ["constant -90 degrees"],
    ),
    "clockwise": (replace(ESTIMATE, quat_wxyz=quaternion_of_yaw(-YAW)), ["sign reversed"]),
    "standing": (
        replace(ESTIMATE, positions_m=np.ones((N, 3)), quat_wxyz=quaternion_of_yaw(np.zeros(N))),
        ["stands still while the true path extends over"],
    ),
    "w last": (replace(ESTIMATE, quat_wxyz=np.column_stack([X, Y, Z, W])), ["w last"]),
    "radians as degrees": (
        replace(ESTIMATE, quat_wxyz=None, yaw=np.radians(YAW)),
        ["radians in a column of degrees"],
    ),
    "inverted": (
        PoseSeries.of("est.tum", Trajectory(ESTIMATE.stamps_ns, inverse(ESTIMATE.trajectory.poses))),
        ["inverted"],
    ),
    "4 % too large": (replace(ESTIMATE, positions_m=1.04 * ESTIMATE.positions_m), ["1.04 times as large"]),
    "another point of the robot": (
        PoseSeries.of(
            "est.tum",
            Trajectory(ESTIMATE.stamps_ns, compose(ESTIMATE.trajectory.poses, np.array([0.6, -0.2, 0.0]))),
        ),
        ["another point of the robot, -0.60 m ahead and +0.20 m to the left"],
    ),
    "a jump": (
        replace(
            ESTIMATE, positions_m=ESTIMATE.positions_m + 25.0 * (np.arange(N) >= 140)[:, None] * [1, 0, 0]
        ),
        ["jumps: by 25", "s while the truth moves 0."],
    ),
    "a part": (part(50), ["covers 4.9 of the 19.9 s of the true path (25%)"]),
    "repeated stamps": (
        replace(ESTIMATE, stamps_ns=np.repeat(ESTIMATE.stamps_ns[::2], 2)),
        ["100 of 200 poses repeat a stamp"],
    ),
    "whole seconds": (
        replace(ESTIMATE, stamps_ns=ESTIMATE.stamps_ns // 1_000_000_000 * 1_000_000_000),
        ["whole seconds: were their fractions lost?"],
    ),
    "other frame": (moved((10.0, -4.0, 0.7)), ["different frames", "--align se2"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_a_remark_that_names_its_cause(name: str) -> None:
    estimate, words = MISTAKES[name]
    found = " | ".join(remarks(estimate))
    for word in words:
        assert word in found


@pytest.mark.parametrize("name", ["millimetres", "mirrored", "other clock"])
def test_the_cause_is_named_after_alignment_too(name: str) -> None:
    estimate, words = MISTAKES[name]
    assert words[0] in " | ".join(remarks(estimate, "se2"))


def test_mistakes_in_the_truth_are_named_as_well() -> None:
    wrong = replace(TRUTH, quat_wxyz=np.column_stack([Z, W, X, Y]))
    assert any(
        line.startswith("truth.tum: ") and "w first" in line for line in remarks(ESTIMATE, truth=wrong)
    )


def test_a_rotation_of_several_turns_in_radians_is_not_taken_for_degrees() -> None:
    angle = np.linspace(0.0, 8.0 * np.pi, N)
    positions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(N)]) * 3.0
    spiral = PoseSeries("est.txt", ESTIMATE.stamps_ns, positions, yaw=angle + np.pi / 2)
    assert remarks(spiral, truth=spiral) == []


@pytest.mark.parametrize(
    ("stamps", "says"),
    [
        (np.round(TIME * 1e9).astype(np.int64), "--time-offset 1311875572.000"),
        (np.full(N, 5_000_000_000, np.int64), "all stamps of est.tum are the same"),
        (ESTIMATE.stamps_ns + 50_000_000, "--sync interpolate pairs 199, and a larger --max-difference"),
    ],
)
def test_series_without_a_stamp_in_common_are_an_error_with_advice(stamps: np.ndarray, says: str) -> None:
    estimate = replace(ESTIMATE, stamps_ns=stamps)
    result = Result(trajectory=estimate.trajectory, series=estimate)
    with pytest.raises(InputError) as error:
        check_pairs(result, Truth(trajectory=TRUTH.trajectory, series=TRUTH), EvaluationOptions())
    assert says in str(error.value)


def test_a_jump_is_not_taken_for_a_scale() -> None:
    estimate, _ = MISTAKES["a jump"]
    assert not any("times as large" in remark for remark in remarks(estimate))
