"""What a run knows about its poses, on its trajectory."""

from __future__ import annotations

import numpy as np

from gridslam.core.trajectory import Trajectory, stretches
from gridslam.methods.base import RunResult, Series
from gridslam.report.marks import marks_of, untrusted_stretches

STAMPS = np.arange(10, dtype=np.int64) * 1_000_000_000
PATH = Trajectory(STAMPS, np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)]))


def test_stretches_are_the_runs_of_true() -> None:
    mask = np.array([1, 0, 1, 1, 0, 0, 0, 0, 0, 1], bool)
    assert stretches(STAMPS, mask).tolist() == [[0, 0], [2_000_000_000, 3_000_000_000], [9_000_000_000] * 2]
    assert stretches(STAMPS, np.zeros(10, bool)).shape == (0, 2)
    assert stretches(STAMPS[:0], np.zeros(0, bool)).shape == (0, 2)


def test_marks_belong_to_the_poses_of_their_stamps() -> None:
    result = RunResult(
        PATH,
        loops_ns=np.array([[1_100_000_000, 7_900_000_000]], np.int64),
        untrusted_ns=np.array([[2_000_000_000, 4_000_000_000]], np.int64),
        position_std=Series(STAMPS[::9], np.array([0.0, 0.9]), "m"),
    )
    marks = marks_of(result)
    assert np.flatnonzero(marks.is_untrusted).tolist() == [2, 3, 4]
    assert marks.loops.tolist() == [[[1.0, 0.0], [8.0, 0.0]]]
    np.testing.assert_allclose(marks.std_m[[0, 1, 5, 9]], [0.0, 0.1, 0.5, 0.9])
    assert np.isnan(marks.std_m[2:5]).all()
    (stretch,) = untrusted_stretches(result)
    assert (stretch.first_s, stretch.last_s, stretch.x_m) == (2.0, 4.0, 2.0)


def test_a_result_without_poses_or_marks_has_none() -> None:
    assert not len(marks_of(RunResult(Trajectory.empty())).std_m)
    assert not list(untrusted_stretches(RunResult(PATH)))
    one = RunResult(Trajectory(STAMPS[:1], PATH.poses[:1]), loops_ns=np.zeros((1, 2), np.int64))
    assert marks_of(one).loops.tolist() == [[[0.0, 0.0], [0.0, 0.0]]]
