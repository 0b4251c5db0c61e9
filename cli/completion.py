"""Completion of names in the shell: built-in configurations and worlds, and YAML files."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable


def complete_config(incomplete: str) -> list[str]:
    """Built-in configurations and YAML files that begin like this."""
    from gridslam.config.builtin import builtin_names

    return _matches(builtin_names(), incomplete)


def complete_world(incomplete: str) -> list[str]:
    """Built-in worlds and YAML files that begin like this."""
    from gridslam.simulation.world_config import builtin_worlds

    return _matches(builtin_worlds(), incomplete)


def _matches(names: Iterable[str], incomplete: str) -> list[str]:
    found = [name for name in names if name.startswith(incomplete)]
    for path in sorted(glob.glob(f"{glob.escape(incomplete)}*")):  # noqa: PTH207 - keeps ./ and // as typed
        if os.path.isdir(path):  # noqa: PTH112
            found.append(f"{path}/")
        elif path.endswith((".yaml", ".yml")):
            found.append(path)
    return found
