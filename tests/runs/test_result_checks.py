"""Streams of which nothing was used are named."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import MethodError
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import RunResult
from gridslam.runs.result_checks import refuse_empty_result, unused_stream_line, unused_streams
from gridslam.runs.run_counts import merge_counts

LOG = {"read.scan": 60, "read.depth": 12, "read.tags": 5, "read.imu": 3}


def test_a_stream_is_unused_if_every_message_was_skipped_for_a_reason() -> None:
    counts = merge_counts(
        LOG, {"used.scan": 59, "skipped.scan.too_short": 1, "used.imu": 0, "skipped.depth.no_calibration": 12}
    )
    assert unused_streams(counts) == ["depth"]
    line = unused_stream_line("depth", counts, set())
    assert line == "none of the 12 depth messages was used (12 x no_calibration)"


def test_the_input_that_would_make_use_of_a_stream_is_advised() -> None:
    counts = merge_counts(LOG, {"skipped.tags.no_database": 5})
    line = unused_stream_line("tags", counts, {"tags"})
    assert line == "none of the 5 tags messages was used (5 x no_database); add --tags FILE"


def test_a_result_without_a_pose_is_refused_with_the_first_place_and_what_to_do() -> None:
    counts = merge_counts({"read.stereo": 0, "skipped.stereo.unknown_encoding": 8}, {})
    problems = ["a note", "skipped 8 x stereo.unknown encoding, first at /left message 1: 'rgb10le'"]
    with pytest.raises(
        MethodError,
        match=r"first at /left message 1: 'rgb10le'; record the pictures in an encoding of the page",
    ):
        refuse_empty_result("stereo-bayes", Path("a.mcap"), RunResult(Trajectory.empty()), counts, problems)
