"""Compiled loops over bare arrays: the only home of numba."""

from __future__ import annotations

import os

# Threads that wait shall sleep: spinning ones starve the rest as soon as the machine has other work (six times slower,
# measured). libgomp reads this when numba loads it.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
