"""Converts values that Python code gives for keys to values that a YAML file can have."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from gridslam.config.errors import short
from gridslam.core.errors import ConfigError


def plain_value(value: object, key: str) -> Any:
    """The value of a key as numbers, strings, lists and mappings. Numpy arrays and scalars are converted, paths become strings.

    Raises ConfigError, which names the key: the value cannot be converted.
    """
    if isinstance(value, BaseModel):  # a section of a loaded configuration
        return value.model_dump(mode="json", exclude_none=True)
    if isinstance(value, Mapping):
        return {name: plain_value(item, f"{key}.{name}") for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(item, key) for item in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if to_list := getattr(value, "tolist", None):  # arrays and scalars of numpy, and what imitates them
        return plain_value(to_list(), key)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise ConfigError(
        f"{key}: {short(value)} is of type {type(value).__name__}; give numbers, texts, lists, mappings or arrays"
    )
