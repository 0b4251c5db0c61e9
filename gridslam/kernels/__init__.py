"""Compiled loops over bare arrays: the only home of numba."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

# Threads that wait shall sleep: spinning ones starve the rest as soon as the machine has other work (six times slower,
# measured). libgomp reads this when numba loads it.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def cache_directory(package: Path) -> Path:
    """Where the machine code of the kernels in a package folder is kept: one folder for each state of all its sources.

    Left to itself numba looks at one source file at a time, and would go on using code that has constants of another
    file's older state compiled into it. The folder lies beside the sources, or in the user's cache where that is read-only.
    """
    digest = hashlib.sha256()
    for source in sorted(package.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    beside = package / "__pycache__"
    if os.access(beside if beside.is_dir() else package, os.W_OK):
        return beside / name
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "gridslam" / name


if not os.environ.get("NUMBA_CACHE_DIR"):
    os.environ["NUMBA_CACHE_DIR"] = str(cache_directory(Path(__file__).parent))
