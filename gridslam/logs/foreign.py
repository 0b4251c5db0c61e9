"""Files that people take for logs and that are not read: what they are, and how their data gets into a log."""

from __future__ import annotations

import re
from pathlib import Path

from gridslam.core.texts import is_number

_TO_TABLES = "into a folder of CSV files, whose columns a log.yaml names (see the page on formats)"
_BY_BEGINNING = (
    (b"PK\x03\x04", "a zip archive: unpack it, and give the log or the folder in it"),
    (b"MATLAB 5.0 MAT-file", f"a MAT-file, which is not read: write its variables {_TO_TABLES}"),
    (
        b"\xd4\xc3\xb2\xa1",
        "packets of a network (pcap): replay them with the lidar's driver, and record its point clouds",
    ),
    (
        b"\n\r\r\n",
        "packets of a network (pcapng): replay them with the lidar's driver, and record its point clouds",
    ),
)


def advice_for(path: Path, beginning: bytes) -> str | None:
    """Advice on a file of a known foreign format, recognised by its first unpacked bytes; None for other files.

    The text names the format and the way to convert it.
    """
    for magic, advice in _BY_BEGINNING:
        if beginning.startswith(magic):
            return advice
    words = re.split(rb"[,;\s]+", beginning.partition(b"\n")[0].strip())
    is_table = len(words) > 2 and (path.suffix.lower() == ".csv" or all(map(is_number, words)))
    named = (
        f"name its columns in the config: log: {{csv: {{streams: [{{kind: scan, file: {path.name}, ...}}]}}}}"
    )
    return f"a table alone: {named}, or put it {_TO_TABLES}" if is_table else None
