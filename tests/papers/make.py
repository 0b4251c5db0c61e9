"""`make papers`: repeats the experiments of the five papers and writes the results beside theirs into docs/papers.md.

`python -m tests.papers.make [NAME ...] [--seeds N] [--jobs N]` writes single sections, with the first N seeds only. Runs of the
present version of the program are kept under out/papers and are not repeated.
"""

from __future__ import annotations

import argparse
import importlib
import os
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from gridslam.core.threads import VARIABLES
from tests.benchmarks.harness import say
from tests.conftest import REPOSITORY
from tests.papers.page import write_section
from tests.papers.work import Work

PAGE = REPOSITORY / "docs" / "papers.md"
FOLDER = REPOSITORY / "out" / "papers"
NAMES = ("stereo-bayes", "ir-scan", "slam-sd", "ispace-mcl", "handmap-slam")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the named sections, or all."""
    parser = argparse.ArgumentParser(prog="python -m tests.papers.make")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--seeds", type=int, help="only the first N seeds of each experiment")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--page", type=Path, help="default: docs/papers.md; with --seeds out/papers/papers.md"
    )
    given = parser.parse_args(arguments)
    names = given.names or NAMES
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        parser.error(f"no paper {unknown[0]!r}; there are: {', '.join(NAMES)}")
    page = given.page or (PAGE if given.seeds is None else FOLDER / PAGE.name)
    modules = {name: module_of(name) for name in names}
    for name, module in modules.items():
        say(f"{name}: {module.CPU_MINUTES:.0f} minutes of processor time, less for finished runs")
    say(
        f"in total {sum(module.CPU_MINUTES for module in modules.values()) / given.jobs:.0f} minutes on {given.jobs} cores"
    )
    for name in VARIABLES:
        os.environ.setdefault(name, "1")  # in each process: the processes share the cores
    for name, module in modules.items():
        started = time.perf_counter()
        section = module.section(Work(FOLDER / name, given.jobs, given.seeds))
        write_section(page, section, NAMES)
        say(f"{name}: {time.perf_counter() - started:.0f} s")


def module_of(name: str) -> ModuleType:
    """The module of a section, with `CPU_MINUTES` and `section(work)`."""
    return importlib.import_module(f"tests.papers.{name.replace('-', '_')}")


if __name__ == "__main__":
    main()
