from __future__ import annotations

from gridslam.runs.run_counts import StreamCount, merge_counts


def test_what_reader_and_method_skipped_adds_up() -> None:
    counts = merge_counts(
        {"read.scan": 10, "read.odom": 5, "skipped.scan.nan": 2, "lost.bytes": 7, "late.scan": 1},
        {"used.scan": 5, "skipped.scan.no_pose": 4, "skipped.scan.nan": 1},
    )
    assert counts.streams == {"odom": StreamCount(5, 5, 0), "scan": StreamCount(12, 5, 7)}
    assert counts.skipped_by_reason == {"scan.nan": 3, "scan.no_pose": 4}
    assert counts.lost == {"bytes": 7}
    assert counts.remarks == {"late.scan": 1}


def test_a_method_that_only_says_what_it_skipped_has_used_the_rest() -> None:
    assert merge_counts({"read.scan": 10}, {"skipped.scan.early": 3}).streams["scan"] == StreamCount(10, 7, 3)
