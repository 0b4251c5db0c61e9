"""Files of a folder without metadata.yaml that are the parts of one recording.

A recorder splits NAME into NAME_0, NAME_1, ..., and users number their drives in the same way. A part begins when the previous
one ends, within the time between two messages. A separate drive begins later, or at any time on another robot.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from gridslam.core.errors import LogError
from gridslam.logs.encoding.csv_row import path_inside
from gridslam.logs.mcap.file import McapFile
from gridslam.logs.message_counts import MessageCounts
from gridslam.logs.rosbag.database import DatabaseFile
from gridslam.logs.rosbag.packed import is_packed

_PART_NAME = re.compile(r"(?P<stem>.+?)(_(?P<number>[0-9]{1,9}))?\.(db3|mcap)(\.zstd|\.zst)?")
_SQLITE_MAGIC = b"SQLite format 3\0"
# Longest break between two parts: stopping a recorder and starting it again takes longer
_MAX_BREAK_NS = 2_000_000_000
_MAX_OVERLAP_NS = 1_000_000_000  # longest overlap of two parts: messages of a cache are written late
_LIMIT_BYTES = 1 << 20  # no message is read here


def recorded_parts(folder: Path) -> list[Path]:
    """The files of one recording in a folder without metadata.yaml, in order of their numbers; none where they are of several."""
    found = numbered_files(folder)
    return [] if why_several(found) else found


def numbered_files(folder: Path) -> list[Path]:
    """The recordings of a folder in order of their numbers; none where their names differ by more than the number."""
    found = {}
    for path in sorted(folder.iterdir()):
        match = _PART_NAME.fullmatch(path.name)
        if match and path_inside(folder, path.name) is not None and path.is_file():
            found[path] = match
    stems = {match["stem"] for match in found.values()}
    return sorted(found, key=lambda path: int(found[path]["number"] or 0)) if len(stems) == 1 else []


def why_several(files: Sequence[Path]) -> str:
    """The evidence that files are separate recordings, as a clause; "" if they may be the parts of one."""
    if len(files) < 2:
        return ""
    spans = [(span, path) for path in files if (span := recorded_span(path)) is not None]
    spans.sort(key=lambda pair: pair[0])
    for ((_, end_ns), before), ((start_ns, _), after) in pairwise(spans):
        if start_ns - end_ns > _MAX_BREAK_NS:
            return f"{(start_ns - end_ns) / 1e9:.1f} s lie between {before.name} and {after.name}"
        if end_ns - start_ns > _MAX_OVERLAP_NS:
            return f"{before.name} and {after.name} were recorded at the same time"
    return ""


def recorded_span(path: Path) -> tuple[int, int] | None:
    """Times of arrival (ns) of the first and the last message of a file; None if packed or without an index of them."""
    if is_packed(path):
        return None
    counts = MessageCounts()
    try:
        with path.open("rb") as stream:
            is_database = stream.read(len(_SQLITE_MAGIC)) == _SQLITE_MAGIC
        opened = (DatabaseFile if is_database else McapFile)(path, counts, _LIMIT_BYTES)
    except LogError:  # damaged, which opening it again explains
        return None
    span = opened.span_ns
    return None if span is None or span[0] > span[1] else span
