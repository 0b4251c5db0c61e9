"""Hashes of the contents of a run's inputs, whatever the names of the files: equal hashes give equal runs."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import gridslam
from gridslam.core.errors import ConfigError
from gridslam.core.plain_files import sha256_of
from gridslam.maps.map_yaml import read_map_yaml
from gridslam.methods.plugins import plugin_sources
from gridslam.report.environment import made_with

_WITHOUT_EFFECT_ON_RESULTS = frozenset({"cli", "sweep"})


def content_key(**parts: Any) -> str:
    """The hash of named values in JSON types."""
    text = json.dumps(parts, sort_keys=True, ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


@functools.cache
def program_key() -> str:
    """The hash of the program: its sources, the sources of plug-in methods, and the versions of Python and libraries."""
    package = Path(gridslam.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        name = source.relative_to(package)
        if name.parts[0] not in _WITHOUT_EFFECT_ON_RESULTS:
            digest.update(f"{name.as_posix()}\0".encode() + source.read_bytes())
    plugins = [_hash_of_folder(path) if path.is_dir() else sha256_of(path) for path in plugin_sources()]
    return content_key(sources=digest.hexdigest(), versions=made_with().model_dump(), plugins=plugins)


class Hashes:
    """Hashes of files and folders; each file is read once."""

    def __init__(self) -> None:
        self._known: dict[Path, str] = {}

    def of(self, path: Path) -> str:
        """The hash of a file, or of all files of a folder with their names. Raises ConfigError if one cannot be read."""
        if path not in self._known:
            try:
                self._known[path] = _hash_of_folder(path) if path.is_dir() else sha256_of(path)
            except OSError as error:
                name = error.filename or path
                raise ConfigError(f"{name}: cannot be read ({error.strerror or error})") from None
        return self._known[path]

    def of_map(self, path: Path) -> str:
        """The hash of a map; for a map_server YAML it includes the image."""
        if path.suffix.lower() not in (".yaml", ".yml"):
            return self.of(path)
        return content_key(yaml=self.of(path), image=self.of(path.parent / read_map_yaml(path).image))


def _hash_of_folder(path: Path) -> str:
    return content_key(files=[(name.as_posix(), sha256_of(path / name)) for name in _files_in(path)])


def _files_in(path: Path) -> Iterable[Path]:
    files = (file.relative_to(path) for file in path.rglob("*") if file.is_file())
    return sorted(file for file in files if "__pycache__" not in file.parts)
