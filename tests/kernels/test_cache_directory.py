"""Where compiled kernels are kept."""

from __future__ import annotations

from pathlib import Path

from gridslam.kernels import cache_directory


def test_a_change_of_any_source_leads_to_another_folder(tmp_path: Path) -> None:
    (tmp_path / "constants.py").write_text("SIZE = 16\n")
    (tmp_path / "loops.py").write_text("from constants import SIZE\n")
    before = cache_directory(tmp_path)
    assert cache_directory(tmp_path) == before
    (tmp_path / "constants.py").write_text("SIZE = 8\n")
    assert cache_directory(tmp_path) != before


def test_the_folder_lies_beside_the_sources_where_that_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "loops.py").write_text("")
    assert cache_directory(tmp_path).parent == tmp_path / "__pycache__"
