"""The page that sets our figures beside the papers'."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.papers.page import ComparedTable, Section, begin, end, with_section, write_section

TABLE = ComparedTable("Walls", ("", "paper", "here"), [("mean, cm", 3.376, 1.0), ("maximum, cm", 19.4, None)])


def empty_page(*names: str) -> str:
    return "# Papers\n\n" + "\n\n".join(f"{begin(n)}\n{end(n)}" for n in names) + "\n"


def test_numbers_stand_to_the_right_and_what_is_missing_is_a_dash() -> None:
    assert TABLE.markdown().splitlines()[2:] == [
        "|  | paper | here |",
        "| --- | ---: | ---: |",
        "| mean, cm | 3.38 | 1 |",
        "| maximum, cm | 19.4 | - |",
    ]


def test_a_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="2 values under 3 columns"):
        ComparedTable("Walls", ("", "paper", "here"), [("mean", 1.0)]).markdown()


def test_a_section_is_replaced_and_the_others_stay() -> None:
    first, second = (Section(n, n.upper(), f"text of {n}", [TABLE]) for n in ("a", "b"))
    page = with_section(with_section(empty_page("a", "b"), first), second)
    newer = Section("a", "A", "newer \\1 text", [])
    replaced = with_section(page, newer)
    assert "text of b" in replaced
    assert "newer \\1 text" in replaced
    assert "text of a" not in replaced
    assert with_section(replaced, newer) == replaced


def test_a_page_without_a_place_for_the_section_is_an_error() -> None:
    with pytest.raises(ValueError, match="0 places for c"):
        with_section(empty_page("a"), Section("c", "C", "", []))


def test_pictures_lie_beside_the_page(tmp_path: Path) -> None:
    page = tmp_path / "papers.md"
    page.write_text(empty_page("a"))
    rgb = np.zeros((2, 3, 3), np.uint8)
    rgb[0, 1] = (250, 20, 10)
    write_section(page, Section("a", "A", "", [], {"walls": (rgb, "The walls")}))
    assert "![The walls](images/papers-walls.png)" in page.read_text()
    with Image.open(tmp_path / "images" / "papers-walls.png") as picture:
        assert np.array_equal(np.asarray(picture), rgb)
