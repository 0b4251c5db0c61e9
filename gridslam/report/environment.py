"""What the run ran on: versions for run.yaml, the memory it took."""

from __future__ import annotations

import platform
import resource
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import gridslam
from gridslam.runs.run_config import MadeWith

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "opencv-python-headless", "pillow")


def made_with() -> MadeWith:
    """The versions that decide the bytes of a result."""
    return MadeWith(
        gridslam=gridslam.__version__,
        python=platform.python_version(),
        libraries={name: installed for name in LIBRARIES if (installed := _version(name))},
        machine=f"{platform.system()} {platform.machine()}",
    )


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


def peak_memory_mb() -> float:
    """The most memory that this process has held, in 10^6 bytes.

    Linux's ru_maxrss also counts what a parent held before the program started, so the process's own
    high-water mark is asked first.
    """
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    except (OSError, ValueError, IndexError):
        pass  # not Linux, or /proc is not mounted: the portable measure below
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6


def restart_peak_memory() -> None:
    """Let `peak_memory_mb` count anew, for the next run of one process; without effect where the system cannot."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
