from __future__ import annotations

import bz2
import gzip
from pathlib import Path

from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.text import TextLines, beginning


def test_a_packed_bomb_without_line_ends_is_read_no_further_than_any_log_reaches(tmp_path: Path) -> None:
    path = tmp_path / "bomb"
    path.write_bytes(gzip.compress(b"first\n" + b"0" * 50_000_000 + b"\nlast\n", 9))
    message_counts = MessageCounts()
    lines = list(TextLines(path, message_counts, 1 << 20))
    assert lines == [(1, b"first")]
    assert message_counts.counters == {"lost.rest_of_packed_text": 1}


def test_a_cut_packed_text_gives_the_lines_before_the_cut(tmp_path: Path) -> None:
    path = tmp_path / "cut"
    text = b"".join(b"line %d\n" % i for i in range(5000))
    packed = gzip.compress(text, mtime=0)
    path.write_bytes(packed[: len(packed) // 2])
    message_counts = MessageCounts()
    lines = [line for _, line in TextLines(path, message_counts, 1 << 20)]
    assert len(lines) > 1000
    assert lines == text.splitlines()[: len(lines)]
    assert message_counts.counters["lost.rest_of_packed_text"] == 1
    assert beginning(path).startswith(b"line 0\n")


def test_the_lines_are_the_same_on_every_pass_and_counted_once(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"a\r\nb\n\nc")
    message_counts = MessageCounts()
    lines = TextLines(path, message_counts, 100)
    assert list(lines) == list(lines) == [(1, b"a"), (2, b"b"), (4, b"c")]


def test_a_line_that_is_too_long_is_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"first\n" + b"0" * 3_000_000 + b"\nlast\n")
    message_counts = MessageCounts()
    assert list(TextLines(path, message_counts, 1 << 20)) == [(1, b"first"), (3, b"last")]
    assert message_counts.counters == {"lost.too_long_line": 1}


def test_a_bzip2_file_of_a_few_bytes_does_not_unpack_to_hundreds_of_megabytes(tmp_path: Path) -> None:
    path = tmp_path / "newlines.clf.bz2"
    path.write_bytes(bz2.compress(b"\n" * 20_000_000))
    message_counts = MessageCounts()
    assert list(TextLines(path, message_counts, 1 << 20)) == []
    assert message_counts.counters == {"lost.rest_of_packed_text": 1}


def test_lines_that_are_not_needed_any_more_keep_their_first_bytes(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_bytes(b"first line\n\nsecond line\n")
    lines = TextLines(path, MessageCounts(), 1000)
    assert list(lines) == [(1, b"first line"), (3, b"second line")]
    lines.shorten({1}, 5)
    assert list(lines) == [(1, b"first"), (3, b"second line")]
