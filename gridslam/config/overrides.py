"""`--set method.particles=50`, and settings of Python code: values of single keys, which take precedence over the file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gridslam.config.errors import short
from gridslam.config.plain_values import plain_value
from gridslam.config.yaml_file import parse_value
from gridslam.core.errors import ConfigError


def apply_overrides(document: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """A copy of the document with each "key.path=value" applied; the value is parsed as YAML.

    Raises ConfigError: no "=", an empty key, or a path through a value that is not a section.
    """
    changed = _copied(document)
    for override in overrides:
        path, equals, text = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            raise ConfigError(
                f"--set {override}: expected key.path=value, for example --set method.particles=50"
            )
        _set(changed, keys, parse_value(text, f"--set {override}"), f"--set {override}")
    return changed


def apply_settings(document: dict[str, Any], settings: Mapping[str, object]) -> dict[str, Any]:
    """A copy of the document with settings of Python code by key path: `{"method.particles": 50}`.

    Raises ConfigError: a value has no form in YAML, or a path leads through a value that is not a section.
    """
    changed = _copied(document)
    for path, value in settings.items():
        _set(changed, path.split("."), plain_value(value, path), path)
    return changed


def overridden_keys(overrides: Iterable[str]) -> list[str]:
    """The key paths that overrides set."""
    return [".".join(key.strip() for key in override.partition("=")[0].split(".")) for override in overrides]


def _set(document: dict[str, Any], keys: list[str], value: object, source: str) -> None:
    """Set the value at a path of keys; sections that are missing or empty are made."""
    section = document
    for depth, key in enumerate(keys[:-1]):
        below = section.setdefault(key, {})
        if below is None:
            below = section[key] = {}
        if not isinstance(below, dict):
            parent = ".".join(keys[: depth + 1])
            raise ConfigError(f"{source}: {parent} is a value ({short(below)}), not a section")
        section = below
    section[keys[-1]] = value


def _copied(document: dict[str, Any]) -> dict[str, Any]:
    """A deep copy of a YAML document; nodes shared by aliases are copied separately."""
    return {key: _copy(item) for key, item in document.items()}


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return _copied(value)
    if isinstance(value, list):
        return [_copy(item) for item in value]
    return value
