"""docs/papers.md: a section per paper between its own marks, so that each section can be updated alone."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.files import write_atomic

MAX_BYTES = 150_000  # of a picture
COLUMNS = ("", "the paper", "gridslam, the paper's form", "gridslam", "seeds")
HEAD = """# The papers' tables and figures, and ours

The results of the five papers, beside those of gridslam in the paper's form (`configs/paper/`) and with its best
settings (`configs/`). The papers' rooms and logs are not public; ours are simulated from their description. A figure
therefore compares the same experiment, not the same room. A dash means not measured.

`make papers` writes this page. It keeps finished runs under `out/papers` and does not repeat them.
`python -m tests.papers.make NAME --seeds 2` writes a preview of one section with few seeds to `out/papers/papers.md`.
"""


@dataclass(frozen=True, slots=True)
class PagePicture:
    """`rgb` is uint8 `(h, w, 3)`; it becomes images/papers-STEM.png."""

    stem: str
    rgb: NDArray[np.uint8]
    caption: str

    def markdown(self) -> str:
        """The picture with its caption below."""
        return f"![{self.caption}](images/papers-{self.stem}.png)\n\n*{self.caption}*"


@dataclass(frozen=True, slots=True)
class Experiment:
    """A table or figure of a paper: what it shows, rows under COLUMNS, pictures, and a note on shortcomings."""

    title: str
    what: str
    rows: Sequence[Sequence[object]]
    pictures: Sequence[PagePicture] = ()
    short: str = ""

    def markdown(self) -> str:
        """Heading, text, table, pictures and note as Markdown."""
        for row in self.rows:
            if len(row) != len(COLUMNS):
                raise ValueError(f"{self.title}: {len(row)} values under {len(COLUMNS)} columns: {row}")
        lines = [COLUMNS, ["---"] * len(COLUMNS), *([cell(value) for value in row] for row in self.rows)]
        table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        parts = [f"### {self.title}", self.what, table, *(p.markdown() for p in self.pictures), self.short]
        return "\n\n".join(part for part in parts if part)


@dataclass(frozen=True, slots=True)
class Section:
    """The section of a paper."""

    name: str
    title: str
    text: str
    experiments: Sequence[Experiment]

    @property
    def pictures(self) -> list[PagePicture]:
        """All pictures of its experiments."""
        return [picture for experiment in self.experiments for picture in experiment.pictures]

    def markdown(self) -> str:
        """The section as Markdown."""
        return "\n\n".join([f"## {self.title}", self.text, *(e.markdown() for e in self.experiments)])


def png_of(rgb: NDArray[np.uint8]) -> bytes:
    """The image as PNG; an image larger than MAX_BYTES gets fewer colours."""
    image = Image.fromarray(rgb)
    png = _coded(image)
    for colours in (256, 64, 16):
        if len(png) <= MAX_BYTES:
            break
        png = _coded(image.quantize(colours, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))
    return png


def _coded(image: Image.Image) -> bytes:
    stream = io.BytesIO()
    image.save(stream, "png", optimize=True)
    return stream.getvalue()


def cell(value: object) -> str:
    """The text of a table cell: numbers with three significant digits, a dash for None."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value).replace("|", "\\|")


def start_mark(name: str) -> str:
    """The mark before a section."""
    return f"<!-- begin {name} -->"


def end(name: str) -> str:
    """The mark after a section."""
    return f"<!-- end {name} -->"


def empty_page(names: Sequence[str]) -> str:
    """The page with empty sections."""
    return HEAD + "".join(f"\n{start_mark(name)}\n{end(name)}\n" for name in names)


def with_section(page: str, section: Section) -> str:
    """The page with a section replaced. Raises ValueError: the page has no marks for it."""
    pattern = re.compile(
        re.escape(start_mark(section.name)) + ".*?" + re.escape(end(section.name)), re.DOTALL
    )
    marked = f"{start_mark(section.name)}\n{section.markdown()}\n{end(section.name)}"
    page, count = pattern.subn(lambda _: marked, page)
    if count != 1:
        raise ValueError(f"the page has {count} places for {section.name}, expected one")
    return page


def write_section(page: Path, section: Section, names: Sequence[str]) -> None:
    """Write a section and its pictures into the page; a missing page is created with empty sections `names`."""
    old = page.read_text(encoding="utf-8") if page.exists() else empty_page(names)
    text = with_section(HEAD + old[old.index(f"\n{start_mark(names[0])}") :], section)
    (page.parent / "images").mkdir(exist_ok=True)
    for picture in section.pictures:
        write_atomic(page.parent / "images" / f"papers-{picture.stem}.png", png_of(picture.rgb))
    write_atomic(page, text.encode())
