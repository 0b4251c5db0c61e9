"""Files that are not logs are named, with what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.core.errors import LogError
from gridslam.logs.config import LogConfig
from gridslam.logs.open import open_log


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5 that cannot be read"),
        ("a.zip", b"PK\x03\x04" + bytes(99), "unpack it"),
        ("a.mat", b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "a MAT-file"),
        ("a.pcap", b"\xd4\xc3\xb2\xa1" + bytes(99), "replay them with the lidar's driver"),
        ("laser.csv", b"time,r0,r1,r2\n1,2,3,4\n", "a table alone: name its columns in the config"),
        ("laser.txt", b"1.5 2.0 3.0 4.0\n", "a table alone"),
        ("letter.txt", b"Dear all,\n", "no log of a known format"),
        ("empty.csv", b"", "empty; readable are"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_log_is_named(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(LogError) as raised:
        open_log(tmp_path / name)
    assert says in str(raised.value)


def test_a_table_that_the_layout_does_not_name_is_not_exchanged_for_one_beside_it(tmp_path: Path) -> None:
    for name in ("mine.txt", "other.txt", "odom.csv"):
        (tmp_path / name).write_text("stamp,x,y,yaw\n1,2,3,0\n")
    streams = [{"kind": "odom", "file": "other.txt"}]
    with open_log(tmp_path / "other.txt", LogConfig.model_validate({"csv": {"streams": streams}})) as log:
        assert [info.count for info in log.streams] == [1]
    for layout in ({"streams": streams}, {}):
        with pytest.raises(LogError, match="not this file"):
            open_log(tmp_path / "mine.txt", LogConfig.model_validate({"csv": layout}))
