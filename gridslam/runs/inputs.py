"""Inputs of a run besides the log: drawings, tag databases, sessions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from gridslam.core.errors import ConfigError
from gridslam.core.plain_files import sha256_of
from gridslam.methods import registry
from gridslam.methods.packaged import naming


@dataclass(frozen=True, slots=True)
class Input:
    """An input of a method besides the log: its content, and the file that it was read from."""

    value: object
    path: Path
    sha256: str


NOTHING_MORE: Mapping[str, Input] = MappingProxyType({})


def read_inputs(paths: Mapping[str, Path], method: str) -> Mapping[str, Input]:
    """The contents of the files that a run takes besides the log, by name, each read by the reader in the method's entry.

    Raises ConfigError: the method does not take one of them, or a file is missing or unreadable. The readers raise their own
    errors for the content.
    """
    refuse_unknown_inputs(method, paths)
    kinds = {kind.name: kind for kind in registry.METHODS[method].inputs}
    inputs = {}
    for name, path in paths.items():
        option = " ".join(registry.option_words(name, str(path)))
        if (file_name := kinds[name].in_run) and path.is_dir():
            path = path / file_name
            if not path.exists():
                raise ConfigError(f"{option}: has no {file_name}; give the directory of a run that left one")
        try:
            digest = sha256_of(path)
        except OSError as error:
            raise ConfigError(f"{option}: cannot be read ({error.strerror or error})") from error
        with naming(registry.package_of(method)):
            inputs[name] = Input(registry.load(kinds[name].reader)(path), path, digest)
    return inputs


def refuse_unknown_inputs(method: str, inputs: Collection[str]) -> None:
    """Raises ConfigError: the method has no use for an input of this name."""
    for name in inputs:
        if name not in registry.METHODS[method].input_names:
            able = [n for n, e in registry.METHODS.items() if name in e.input_names]
            methods = f"methods that have: {', '.join(able)}" if able else "nor has any other method"
            option = " ".join(registry.option_words(name, "FILE"))
            raise ConfigError(f"{option}: {method} has no use for it; {methods}")


def refuse_missing_inputs(method: str, inputs: Mapping[str, Input]) -> None:
    """Raises ConfigError: an input that the method needs is missing."""
    for kind in registry.METHODS[method].inputs:
        if kind.is_needed and kind.name not in inputs:
            option = " ".join(registry.option_words(kind.name, "FILE"))
            raise ConfigError(f"{option}: {method} needs it: add it to the command")
