"""gridslam warmup"""

from __future__ import annotations

import time

from .. import console


def run() -> None:
    """Compile the kernels ahead of the first run."""
    from gridslam.warm_up import warm_up

    started = time.perf_counter()
    warm_up()
    console.emit(f"kernels ready after {time.perf_counter() - started:.1f} s")
