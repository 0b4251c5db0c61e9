"""`--set method.particles=50`: overrides of single keys, which take precedence over the file."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from gridslam.config.errors import short
from gridslam.config.yaml_file import parse_value
from gridslam.core.errors import ConfigError


def apply_overrides(document: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """A copy of the document with each "key.path=value" applied; the value is parsed as YAML.

    Raises ConfigError: no "=", an empty key, or a path through a value that is not a section.
    """
    changed: dict[str, Any] = _copy(document)
    for override in overrides:
        path, equals, text = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            raise ConfigError(
                f"--set {override}: expected key.path=value, for example --set method.particles=50"
            )
        section = changed
        for depth, key in enumerate(keys[:-1]):
            below = section.setdefault(key, {})
            if below is None:
                below = section[key] = {}
            if not isinstance(below, dict):
                parent = ".".join(keys[: depth + 1])
                raise ConfigError(f"--set {override}: {parent} is a value ({short(below)}), not a section")
            section = below
        section[keys[-1]] = parse_value(text, f"--set {override}")
    return changed


def overridden_keys(overrides: Iterable[str]) -> list[str]:
    """The key paths that overrides set."""
    return [".".join(key.strip() for key in override.partition("=")[0].split(".")) for override in overrides]


def _copy(value: Any) -> Any:
    """A deep copy of a YAML value; nodes shared by aliases are copied separately."""
    if isinstance(value, dict):
        return {key: _copy(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_copy(item) for item in value]
    return value
