"""The environment of a run: versions for run.yaml, and the memory used."""

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
    """The versions that can affect the bytes of a result."""
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
    """Peak memory of this process (10^6 bytes).

    On Linux ru_maxrss includes memory of the parent process before exec, so VmHWM is used if available.
    """
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    except (OSError, ValueError, IndexError):
        pass  # not Linux, or /proc is not mounted: use the portable measure
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6


def restart_peak_memory() -> None:
    """Reset the peak of `peak_memory_mb`, for the next run in this process; no effect if the system does not support it."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
