"""Machine code kept in files between runs: where, and what happens when the files are damaged or cannot be written."""

from __future__ import annotations

import atexit
import functools
import hashlib
import logging
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import numba
import numba.core.caching
import numba.core.compiler
import numba.core.serialize
from numba.core.runtime.nrt import rtsys

IMPORT_OF_KERNELS = re.compile(r"^from gridslam\.kernels\.([\w.]+) import ", re.MULTILINE)
DIGEST_BYTES = 32

_Cache: Any = numba.core.caching._Cache  # numba has no types
_dumps: Any = numba.core.serialize.dumps
_rebuild: Any = numba.core.compiler.CompileResult._rebuild
_logger = logging.getLogger("gridslam")


class MachineCodeCache(_Cache):  # type: ignore[misc]
    """The machine code of one kernel: a file for each signature, which says whose it is and begins with a digest.

    So what is damaged, cut or another kernel's is compiled again, and never run. Numba's own files have no digest, and an
    index beside them, which two processes may leave pointing at each other's code.
    """

    complaint: ClassVar[str | None] = None  # why this process could not keep something, said once

    def __init__(self, function: Callable[..., Any]) -> None:
        code = function.__code__
        self._bytecode = hashlib.sha256(code.co_code).hexdigest()
        self._base = f"{function.__qualname__}-{code.co_firstlineno}.{sys.implementation.cache_tag}"
        self._folders = folders_of(Path(code.co_filename))
        self._owners = trusted_owners(Path(code.co_filename))

    @property
    def cache_path(self) -> str:
        """The folder where new machine code is kept."""
        return str(self._folders[0])

    def enable(self) -> None:
        """Part of numba's interface; the cache is always on."""

    def disable(self) -> None:
        """Part of numba's interface; the cache is always on."""

    def flush(self) -> None:
        """Part of numba's interface: outdated code lies in folders of its own, so nothing is removed."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code kept for a signature; None where there is none, or where its file is damaged.

        What only compiling needs is not set up here as numba does: it takes longer than all loading.
        """
        rtsys.initialize(target_context)
        key = self._key(sig, target_context.codegen())
        for folder in self._folders:
            with suppress(Exception):  # no file, a damaged one, or one of another version of numba
                return _rebuild(target_context, *_read(folder / self._name(key), key, self._owners))
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code; where it cannot be written, say so once and keep nothing."""
        key = self._key(sig, data.codegen)
        try:
            _write(self._folders[0] / self._name(key), key, data._reduce())
        except OSError as error:
            if MachineCodeCache.complaint is None:
                MachineCodeCache.complaint = (
                    f"compiled kernels cannot be kept in {self._folders[0].parent} ({error.strerror or error}): "
                    "every run compiles them again"
                )
                _logger.warning("%s", MachineCodeCache.complaint)

    def _key(self, signature: Any, codegen: Any) -> tuple[str, ...]:
        """Key of machine code: its signature, the type of processor, the bytecode and the version of numba."""
        return (str(signature), str(codegen.magic_tuple()), self._bytecode, str(numba.__version__))

    def _name(self, key: tuple[str, ...]) -> str:
        return f"{self._base}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.code"


def _read(file: Path, key: tuple[str, ...], owners: Collection[int] | None) -> Any:
    """The machine code in a file.

    Raises OSError; ValueError: it is damaged, another kernel's, of a user that is none of the `owners`, or a device or a pipe.
    """
    if not file.is_file():
        raise ValueError(f"{file}: no file")
    with file.open("rb") as stream:
        owner = os.fstat(stream.fileno()).st_uid
        if owners is not None and owner not in owners:
            raise ValueError(f"{file}: of the user {owner}")
        content = stream.read()
    body = memoryview(content)[DIGEST_BYTES:]
    if content[:DIGEST_BYTES] != _digest(body):
        raise ValueError(f"{file}: damaged")
    kept_key, machine_code = pickle.loads(body)
    if kept_key != key:
        raise ValueError(f"{file}: the machine code of {kept_key}")
    return machine_code


def _write(file: Path, key: tuple[str, ...], machine_code: Any) -> None:
    """Write a file under a temporary name first: of two processes the last wins. Raises OSError."""
    body = _dumps((key, machine_code))
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=".", suffix=".partial", dir=file.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(_digest(body) + body)
        Path(name).chmod(0o644)  # an installation may serve users other than the one who compiled
        Path(name).replace(file)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _digest(body: bytes | memoryview) -> bytes:
    return hashlib.sha256(body).digest()


def folders_of(module: Path) -> tuple[Path, ...]:
    """Folders of a kernel module's machine code: the one that it is written to, then those that it may be read from.

    An installation that was warmed up serves also those who cannot write into it.
    """
    own = cache_directory(module)
    return (own,) if _given_folder() else tuple(dict.fromkeys((own, _beside(module) / own.name)))


def trusted_owners(module: Path) -> frozenset[int] | None:
    """The users whose machine code of a module may be run: this one, root, and that of the sources.

    Machine code is kept as pickles, which can do anything. None: everybody's, in the folder that the user gives.
    """
    return None if _given_folder() else frozenset((os.getuid(), 0, module.stat().st_uid))


@functools.cache
def cache_directory(module: Path) -> Path:
    """Folder for the machine code of a kernel module; another one for each state of it and of the kernels that it uses.

    Left to itself numba looks at one source file at a time, and would go on using code that has constants of another
    file's older state compiled into it. The folder lies below NUMBA_CACHE_DIR where that is set, else beside the sources; in
    the user's cache where those are read-only; in the temporary folder of the machine where that cannot be written
    either. Where none of them can be written, it is beside the sources.
    """
    digest = hashlib.sha256()
    for source in sorted(sources_of(module)):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    name = f"{module.stem}-{digest.hexdigest()[:16]}"
    given, home = _given_folder(), _user_cache()
    candidates = [given] if given else [_beside(module), *([home / "gridslam" / "kernels"] if home else [])]
    for folder in candidates:
        if _is_writable(folder / name):
            return folder / name
    try:
        return _private_temporary_folder() / name
    except OSError:
        return _beside(module) / name


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


def _beside(module: Path) -> Path:
    return module.parent / "__pycache__" / "kernels"


def _given_folder() -> Path | None:
    """The folder that the user gives to all programs with numba."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    return Path(given) if given else None


def _user_cache() -> Path | None:
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        base = base if base.is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # no home directory
        return None
    return base if base.is_absolute() else None


@functools.cache
def _private_temporary_folder() -> Path:
    """A folder of this user in the machine's temporary folder; a new one where somebody else could write into it.

    Raises OSError: there is none.
    """
    folder = Path(tempfile.gettempdir()) / f"gridslam-kernels-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        if stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not state.st_mode & 0o022:
            return folder
    fresh = Path(tempfile.mkdtemp(prefix="gridslam-kernels-"))
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return fresh


def _is_writable(folder: Path) -> bool:
    """Whether files can be written to the folder, which is made if it is missing; permissions alone do not show it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
