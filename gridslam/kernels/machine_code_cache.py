"""Machine code kept in files between runs: where, and what happens when the files are damaged or cannot be written."""

from __future__ import annotations

import atexit
import functools
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator
from numba.core.runtime.nrt import rtsys

IMPORT_OF_KERNELS = re.compile(r"^from gridslam\.kernels\.([\w.]+) import ", re.MULTILINE)


_Cache: Any = FunctionCache  # numba's classes have no types
_Files: Any = CompileResultCacheImpl
_Locator: Any = InTreeCacheLocator


class ContentLocator(_Locator):  # type: ignore[misc]
    """Files of one function, found by what its sources hold: a copy of the folder is valid at any other path and time."""

    def __init__(self, function: Callable[..., Any], module: str) -> None:
        super().__init__(function, module)
        self._cache_path = str(cache_directory(Path(module)))

    def get_source_stamp(self) -> str:
        """The same for all files: the name of their folder tells the state of the sources."""
        return "content"


class ContentFiles(_Files):  # type: ignore[misc]
    """The files of one function where `ContentLocator` finds them, or below NUMBA_CACHE_DIR."""

    _locator_classes = (*_Files._locator_classes[:1], ContentLocator)


class MachineCodeCache(_Cache):  # type: ignore[misc]
    """Numba's cache of one function; damage in its files means that the function is compiled again."""

    _impl_class = ContentFiles

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code kept for a signature; None where there is none, or where its files are damaged.

        What only compiling needs is not set up here as numba does: it takes longer than all loading.
        """
        try:
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception:  # a cut or empty pickle raises almost anything
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code. A damaged index is replaced; a folder that cannot be written (any more) keeps nothing."""
        try:
            super().save_overload(sig, data)
        except OSError:
            return
        except Exception:  # the index is damaged: begin a new one
            try:
                self.flush()
                super().save_overload(sig, data)
            except OSError:
                return


def cache_of(function: Callable[..., Any]) -> MachineCodeCache | None:
    """The cache of a kernel; None where no folder can be written, so that it is compiled in every process."""
    try:
        return MachineCodeCache(function)
    except (OSError, RuntimeError):
        return None


@functools.cache
def cache_directory(module: Path) -> Path:
    """Where the machine code of a kernel module is kept: one folder for each state of it and of the kernels it uses.

    Left to itself numba looks at one source file at a time, and would go on using code that has constants of another
    file's older state compiled into it. The folder lies beside the sources; in the user's cache where those are
    read-only; in the temporary folder of the machine where that cannot be written either.
    """
    digest = hashlib.sha256()
    for source in sorted(sources_of(module)):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    name = f"{module.stem}-{digest.hexdigest()[:16]}"
    candidates = [module.parent / "__pycache__" / "kernels", _user_cache() / "gridslam" / "kernels"]
    for folder in candidates:
        if _is_writable(folder):
            return folder / name
    return _private_temporary_folder() / name


def sources_of(module: Path) -> set[Path]:
    """A kernel module's file and those of all kernel modules that it imports, directly or through others."""
    found: set[Path] = set()
    remaining = [module]
    while remaining:
        source = remaining.pop()
        if source not in found:
            found.add(source)
            remaining += imported_by(source)
    return found


def imported_by(source: Path) -> Iterator[Path]:
    """The files of the kernel modules that one imports; this file decides where machine code lies, not what it is."""
    root = next((folder for folder in source.parents if folder.name == "kernels"), source.parent)
    for name in IMPORT_OF_KERNELS.findall(source.read_text(encoding="utf-8")):
        file = root.joinpath(*name.split(".")).with_suffix(".py")
        if file != Path(__file__):
            yield file


def _user_cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(base) if base else Path.home() / ".cache"
    except RuntimeError:  # no home directory
        return Path(tempfile.gettempdir())


@functools.cache
def _private_temporary_folder() -> Path:
    """A folder of this user in the machine's temporary folder; a new one where somebody else could write into it.

    Machine code is kept as pickles, so files that another user may have put there are never read.
    """
    folder = Path(tempfile.gettempdir()) / f"gridslam-kernels-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        if stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022:
            return folder
    except OSError:
        pass
    fresh = Path(tempfile.mkdtemp(prefix="gridslam-kernels-"))
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return fresh


def _is_writable(folder: Path) -> bool:
    """Whether the folder, or the nearest one above it that exists, takes new files."""
    existing = next((f for f in (folder, *folder.parents) if f.exists()), None)
    return existing is not None and existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
