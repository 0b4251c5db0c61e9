"""Methods of other packages: each names itself in the entry point group `gridslam.methods` (docs/adding-a-method.md)."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Generic, TypeVar

from gridslam.core.errors import ConfigError

GROUP = "gridslam.methods"

Entry = TypeVar("Entry")


class WithPlugins(Mapping[str, Entry], Generic[Entry]):
    """The methods that the program has, and then those of installed packages.

    Packages are looked for when a name is asked for that the program has not, or all names are; an entry of a package is
    loaded when it is asked for. Raises ConfigError, which names the package: an entry that cannot be loaded or is of another
    type, one whose name is taken.
    """

    def __init__(self, own: Mapping[str, Entry], kind: type[Entry]) -> None:
        self._own = own
        self._kind = kind

    def __getitem__(self, name: str) -> Entry:
        if name in self._own:
            return self._own[name]
        return self._loaded(self._points[name])

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._points

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._points

    def __len__(self) -> int:
        return len(self._own) + len(self._points)

    @cached_property
    def _points(self) -> Mapping[str, EntryPoint]:
        found: dict[str, EntryPoint] = {}
        for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
            if point.name in self._own or point.name in found:
                raise ConfigError(
                    f"{_named(point)}: there is a method of this name already; rename it in the package's entry points"
                )
            found[point.name] = point
        return found

    def _loaded(self, point: EntryPoint) -> Entry:
        try:
            entry = point.load()
        except (ImportError, AttributeError) as error:
            raise ConfigError(
                f"{_named(point)}: cannot be loaded ({error}); repair or uninstall the package"
            ) from error
        if not isinstance(entry, self._kind):
            raise ConfigError(
                f"{_named(point)}: {point.value} is a {type(entry).__name__}, expected a {self._kind.__name__}"
            )
        return entry


def plugin_sources() -> list[Path]:
    """The files and folders of all packages that bring methods, in order: what their results depend on."""
    found = set()
    for point in entry_points(group=GROUP):
        spec = importlib.util.find_spec(point.module.partition(".")[0])
        if spec is not None:
            found.update(spec.submodule_search_locations or ([spec.origin] if spec.origin else []))
    return sorted(Path(path) for path in found)


def _named(point: EntryPoint) -> str:
    package = f" of the package {point.dist.name} {point.dist.version}" if point.dist else ""
    return f"method {point.name!r}{package}"
