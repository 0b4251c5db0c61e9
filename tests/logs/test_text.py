from __future__ import annotations

import gzip
from pathlib import Path

from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.text import TextLines, beginning


def test_a_packed_bomb_without_line_ends_costs_no_more_than_one_line(tmp_path: Path) -> None:
    path = tmp_path / "bomb"
    path.write_bytes(gzip.compress(b"first\n" + b"0" * 50_000_000 + b"\nlast\n", 9))
    message_counts = MessageCounts()
    lines = list(TextLines(path, message_counts, 1 << 20))
    assert lines == [(1, b"first"), (2, b""), (3, b"last")]
    assert message_counts.counters["lost.too_long_line"] == 1


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
    assert list(lines) == list(lines) == [(1, b"a"), (2, b"b"), (3, b""), (4, b"c")]
