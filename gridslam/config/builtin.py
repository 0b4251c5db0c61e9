"""The configurations that ship with the program, found by name: `slam-sd`, `paper/slam-sd`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gridslam.config.errors import nearest
from gridslam.config.yaml_file import parse_mapping, read_yaml
from gridslam.core.errors import ConfigError

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable  # Python 3.10 keeps it elsewhere

SECTIONS = ("", "paper/")


def builtin_names() -> list[str]:
    """Names of the built-in method configurations; those of the papers come last."""
    return [prefix + name for prefix in SECTIONS for name in _yaml_names(_folder(prefix))]


def read_config(name_or_path: str) -> tuple[dict[str, Any], str]:
    """The document of a config file or a built-in name, and its name for messages.

    An existing file takes precedence over a built-in name. Raises ConfigError: neither a file nor a name.
    """
    path = Path(name_or_path)
    if path.exists():
        return read_yaml(path), str(path)
    if name_or_path in builtin_names():
        text = _root().joinpath(f"{name_or_path}.yaml").read_text(encoding="utf-8")
        return parse_mapping(text, f"built-in config {name_or_path}"), f"built-in config {name_or_path}"
    prefix = "paper/" if path.parent.name == "paper" else ""
    hint = nearest(prefix + path.name.removesuffix(".yaml"), builtin_names())
    raise ConfigError(f"{name_or_path}: neither a config file nor a built-in name{hint}")


def _root() -> Traversable:
    return files("gridslam.configs")


def _folder(prefix: str) -> Traversable:
    return _root().joinpath(prefix.rstrip("/")) if prefix else _root()


def _yaml_names(folder: Traversable) -> list[str]:
    if not folder.is_dir():
        return []
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))
