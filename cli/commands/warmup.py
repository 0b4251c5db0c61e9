"""gridslam warmup"""

from __future__ import annotations

import time

from .. import console
from ..options import AsJson


def run(as_json: AsJson = False) -> None:
    """Compile all kernels ahead of the first run."""
    from gridslam.runs.warm_up import warm_up

    started = time.perf_counter()
    warm_up()
    seconds = time.perf_counter() - started
    if as_json:
        console.emit_json({"seconds": round(seconds, 3)})
    else:
        console.emit(f"kernels ready after {seconds:.1f} s")
