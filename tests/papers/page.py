"""docs/papers.md: one section a paper, each between its own marks, so that one can be made anew without the others."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.files import write_atomic


@dataclass(frozen=True, slots=True)
class ComparedTable:
    """What a paper measured beside what is measured here; `note` says with which worlds and seeds."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""

    def markdown(self) -> str:
        """The table as Markdown, numbers to the right."""
        body = [[cell(value) for value in row] for row in self.rows]
        for row in body:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"{self.caption}: {len(row)} values under {len(self.columns)} columns: {row}"
                )
        sides = [
            "---:" if is_numeric([row[k] for row in self.rows]) else "---" for k in range(len(self.columns))
        ]
        lines = [list(self.columns), sides, *body]
        text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        note = f"\n\n{self.note}" if self.note else ""
        return f"**{self.caption}**\n\n{text}{note}"


@dataclass(frozen=True, slots=True)
class Section:
    """One paper's section: `pictures` are RGB uint8 `(h, w, 3)` by file name stem, with their captions."""

    name: str
    title: str
    text: str
    tables: Sequence[ComparedTable]
    pictures: Mapping[str, tuple[NDArray[np.uint8], str]] = field(default_factory=dict)

    def markdown(self) -> str:
        """The section below its marks."""
        shown = [f"![{caption}](images/papers-{stem}.png)" for stem, (_, caption) in self.pictures.items()]
        parts = [f"## {self.title}", self.text.strip(), *(t.markdown() for t in self.tables), *shown]
        return "\n\n".join(parts)


def cell(value: object) -> str:
    """A value as a table shows it; numbers to three significant digits, nothing as a dash."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value).replace("|", "\\|")


def is_numeric(values: Sequence[object]) -> bool:
    """Whether a column holds numbers only, and one at least."""
    present = [v for v in values if v is not None]
    return bool(present) and all(isinstance(v, int | float) for v in present)


def begin(name: str) -> str:
    """The mark before a section."""
    return f"<!-- begin {name} -->"


def end(name: str) -> str:
    """The mark behind a section."""
    return f"<!-- end {name} -->"


def with_section(page: str, section: Section) -> str:
    """The page with a section put in place of its older state; ValueError: the page has no marks for it."""
    pattern = re.compile(re.escape(begin(section.name)) + ".*?" + re.escape(end(section.name)), re.DOTALL)
    marked = f"{begin(section.name)}\n{section.markdown()}\n{end(section.name)}"
    page, count = pattern.subn(lambda _: marked, page)
    if count != 1:
        raise ValueError(f"the page has {count} places for {section.name}, expected one")
    return page


def write_section(page: Path, section: Section) -> None:
    """Put a section into the page and its pictures beside it."""
    text = with_section(page.read_text(encoding="utf-8"), section)
    (page.parent / "images").mkdir(exist_ok=True)
    for stem, (rgb, _) in section.pictures.items():
        coded, png = cv2.imencode(".png", rgb[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
        if not coded:
            raise ValueError(f"{stem}: the picture cannot be written as PNG")
        write_atomic(page.parent / "images" / f"papers-{stem}.png", png.tobytes())
    write_atomic(page, text.encode())
