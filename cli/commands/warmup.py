"""gridslam warmup"""

from __future__ import annotations

import os
import time
from typing import Annotated

import typer

from .. import console
from ..options import AsJson

Processes = Annotated[
    int | None, typer.Option("--jobs", min=1, help="Number of processes. Default: one per core.")
]


def run(jobs: Processes = None, as_json: AsJson = False) -> None:
    """Compile all kernels ahead of the first run."""
    from gridslam.runs.warm_up import part_names, warm_up

    started = time.perf_counter()
    waiting = part_names()

    def report(part: str) -> None:
        waiting.remove(part)
        console.say(f"{part} ready, {len(waiting)} to go")

    warm_up(jobs or os.cpu_count() or 1, report)
    seconds = time.perf_counter() - started
    if as_json:
        console.emit_json({"seconds": round(seconds, 3)})
    else:
        console.emit(f"kernels ready after {seconds:.1f} s")
