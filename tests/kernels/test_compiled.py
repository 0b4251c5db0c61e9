"""Where compiled kernels are kept."""

from __future__ import annotations

from pathlib import Path

from gridslam.kernels import raycast
from gridslam.kernels.compiled import cache_directory, sources_of


def folder_of(module: Path) -> Path:
    cache_directory.cache_clear()
    return cache_directory(module)


def test_a_change_of_a_source_that_is_used_leads_to_another_folder(tmp_path: Path) -> None:
    constants, tables, loops = (tmp_path / f"{name}.py" for name in ("constants", "tables", "loops"))
    constants.write_text("SIZE = 16\n")
    tables.write_text("from gridslam.kernels.constants import SIZE\n")
    loops.write_text("import numpy\n\nfrom gridslam.kernels.tables import SIZE\n")
    before = folder_of(loops)
    assert folder_of(loops) == before
    constants.write_text("SIZE = 8\n")
    assert folder_of(loops) != before


def test_a_change_of_another_source_leads_to_the_same_folder(tmp_path: Path) -> None:
    (tmp_path / "loops.py").write_text("")
    before = folder_of(tmp_path / "loops.py")
    (tmp_path / "others.py").write_text("from gridslam.kernels.loops import nothing\n")
    assert folder_of(tmp_path / "loops.py") == before


def test_sources_that_import_each_other_end(tmp_path: Path) -> None:
    first, second = tmp_path / "first.py", tmp_path / "second.py"
    first.write_text("from gridslam.kernels.second import b\n")
    second.write_text("from gridslam.kernels.first import a\n")
    assert sources_of(first) == {first, second}


def test_the_folder_lies_beside_the_sources_where_that_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "loops.py").write_text("")
    assert folder_of(tmp_path / "loops.py").parent == tmp_path / "__pycache__" / "kernels"


def test_kernels_are_kept_in_the_folder_of_their_module() -> None:
    folder = Path(raycast.cast._cache.cache_path)
    assert cache_directory(Path(raycast.__file__)) in folder.parents
