"""`make papers`: measures what the five papers measured, and writes it beside their figures into docs/papers.md.

`python -m tests.papers.make [NAME ...]` makes single sections anew. Every section says its worlds and seeds.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.harness import say
from tests.papers.page import Section, write_section

PAGE = Path(__file__).resolve().parents[2] / "docs" / "papers.md"
NAMES = ("stereo-bayes", "ir-scan", "slam-sd", "ispace-mcl", "handmap-slam")


def main(names: Sequence[str]) -> None:
    """Make the named sections, or all."""
    for name in names or NAMES:
        if name not in NAMES:
            raise SystemExit(f"no paper {name!r}; there are: {', '.join(NAMES)}")
        started = time.perf_counter()
        section: Section = importlib.import_module(f"tests.papers.{name.replace('-', '_')}").section()
        write_section(PAGE, section)
        say(f"{name}: {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
