"""Streams of which nothing was used are named."""

from __future__ import annotations

from gridslam.runs.result_checks import unused_stream_line, unused_streams
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
