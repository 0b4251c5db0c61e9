"""Methods of installed packages, found by the entry point group `gridslam.methods` (docs/adding-a-method.md)."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stdout
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Generic, TypeVar

from gridslam.core.errors import ConfigError, message_of

GROUP = "gridslam.methods"

Entry = TypeVar("Entry")


class PluginRegistry(Mapping[str, Entry], Generic[Entry]):
    """Mapping from method name to entry: built-in methods (`own`) first, then those of installed packages.

    Lookup is lazy. Installed packages are searched at the first access to a name that is not built in, or when all names are
    listed. The entry of a package is imported when its name is looked up. Raises ConfigError, which names the package: its entry
    cannot be imported, is not of the type `kind`, has a part for which `problem_of` has words, or has the name of another method.
    """

    def __init__(
        self,
        own: Mapping[str, Entry],
        kind: type[Entry],
        problem_of: Callable[[Entry], str] = lambda entry: "",
    ) -> None:
        self._own = own
        self._kind = kind
        self._problem_of = problem_of

    def __getitem__(self, name: str) -> Entry:
        if name in self._own:
            return self._own[name]
        return self._load(self._entry_points[name])

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._entry_points

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._entry_points

    def __len__(self) -> int:
        return len(self._own) + len(self._entry_points)

    def package_of(self, name: str) -> str:
        """The method and its package in words, for messages; no text for one of the program's own."""
        return "" if name in self._own else _description(self._entry_points[name])

    @cached_property
    def _entry_points(self) -> Mapping[str, EntryPoint]:
        found: dict[str, EntryPoint] = {}
        for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
            if point.name in self._own or point.name in found:
                raise ConfigError(
                    f"{_description(point)}: there is a method of this name already; rename it in the package's entry points"
                )
            found[point.name] = point
        return found

    def _load(self, point: EntryPoint) -> Entry:
        try:
            with redirect_stdout(sys.stderr):
                entry = point.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # what its modules raise when they are imported
            raise ConfigError(
                f"{_description(point)}: cannot be loaded ({type(error).__name__}: {message_of(error)}); "
                "repair or uninstall the package"
            ) from error
        if not isinstance(entry, self._kind):
            raise ConfigError(
                f"{_description(point)}: {point.value} is of type {type(entry).__name__}, expected {self._kind.__name__}"
            )
        if problem := self._problem_of(entry):
            raise ConfigError(f"{_description(point)}: {point.value}: {problem}")
        return entry


def plugin_sources() -> list[Path]:
    """Source files and folders, sorted, of all installed packages that provide methods; results depend on them."""
    found = set()
    for point in entry_points(group=GROUP):
        spec = importlib.util.find_spec(point.module.partition(".")[0])
        if spec is not None:
            found.update(spec.submodule_search_locations or ([spec.origin] if spec.origin else []))
    return sorted(Path(path) for path in found)


def _description(point: EntryPoint) -> str:
    package = f" of the package {point.dist.name} {point.dist.version}" if point.dist else ""
    return f"method {point.name!r}{package}"
