"""Decorators that compile a function, and keep its machine code as long as its sources stay what they are."""

from __future__ import annotations

import functools
import hashlib
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba

IMPORT_OF_KERNELS = re.compile(r"^from gridslam\.kernels\.([\w.]+) import ", re.MULTILINE)


def compiled(function: Callable[..., Any]) -> Any:
    """The function as serial machine code."""
    return _compile(function, parallel=False)


def compiled_parallel(function: Callable[..., Any]) -> Any:
    """The function as machine code whose `prange` loops use all threads."""
    return _compile(function, parallel=True)


def _compile(function: Callable[..., Any], parallel: bool) -> Any:
    if not os.environ.get("NUMBA_CACHE_DIR"):
        vars(numba.config)["CACHE_DIR"] = str(cache_directory(Path(function.__code__.co_filename)))
    return numba.njit(cache=True, parallel=parallel)(function)


@functools.cache
def cache_directory(module: Path) -> Path:
    """Where the machine code of a kernel module is kept: one folder for each state of it and of the kernels it uses.

    Left to itself numba looks at one source file at a time, and would go on using code that has constants of another
    file's older state compiled into it. The folder lies beside the sources, or in the user's cache where that is read-only.
    """
    digest = hashlib.sha256()
    for source in sorted(sources_of(module)):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    name = f"{module.stem}-{digest.hexdigest()[:16]}"
    package = module.parent
    beside = package / "__pycache__"
    if os.access(beside if beside.is_dir() else package, os.W_OK):
        return beside / "kernels" / name
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "gridslam" / "kernels" / name


def sources_of(module: Path) -> set[Path]:
    """A kernel module's file and those of all kernel modules that it imports, directly or through others."""
    found: set[Path] = set()
    left = [module]
    while left:
        source = left.pop()
        if source not in found:
            found.add(source)
            left += imported_by(source)
    return found


def imported_by(source: Path) -> Iterator[Path]:
    """The files of the kernel modules that one imports."""
    root = next((folder for folder in source.parents if folder.name == "kernels"), source.parent)
    for name in IMPORT_OF_KERNELS.findall(source.read_text(encoding="utf-8")):
        yield root.joinpath(*name.split(".")).with_suffix(".py")
