from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evo.tools import file_interface

from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Table
from gridslam.report.text_files import write_table, write_tum


def test_evo_reads_the_trajectory_as_it_was_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    stamps = np.cumsum(rng.integers(1, 10**9, 50)) + 1_700_000_000_000_000_001
    poses = np.column_stack([rng.normal(0, 100, (50, 2)), rng.uniform(-np.pi, np.pi, 50)])
    write_tum(tmp_path / "t.tum", Trajectory(stamps, poses))
    read = file_interface.read_tum_trajectory_file(str(tmp_path / "t.tum"))
    assert np.abs(read.timestamps - stamps / 1e9).max() < 1e-6  # a float holds no more
    assert np.abs(read.positions_xyz - np.column_stack([poses[:, :2], np.zeros(50)])).max() <= 0.5e-9 + 1e-13
    w, z = read.orientations_quat_wxyz[:, 0], read.orientations_quat_wxyz[:, 3]
    assert np.abs(2 * np.arctan2(z, w) - poses[:, 2]).max() < 1e-11


def test_a_table_keeps_numbers_exactly_and_stamps_as_seconds(tmp_path: Path) -> None:
    rows = [
        (1_000_000_001, np.float64(0.1), np.int64(3), True, 'a "b", c'),
        (5, 1e-17, 0, np.bool_(False), None),
    ]
    write_table(tmp_path / "t.csv", Table(("stamp_ns", "x", "n", "moved", "name"), rows))
    assert (tmp_path / "t.csv").read_text() == (
        'stamp,x,n,moved,name\n1.000000001,0.1,3,true,"a ""b"", c"\n0.000000005,1e-17,0,false,\n'
    )


def test_a_row_of_another_length_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="zip"):
        write_table(tmp_path / "t.csv", Table(("a", "b"), [(1,)]))
