"""Message definitions from files, checked before the type library generates code from them.

The library turns names of types and fields into Python source. Only names of a strict pattern reach it, constants never do.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from typing import Any

_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}/msg/[A-Za-z][A-Za-z0-9_]{0,99}")
_FIELD_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,99}")
_BASE_TYPE = re.compile(r"[a-z][a-z0-9]{0,19}")
_MAX_FIELDS = 1000  # largest number of fields of one type
_MAX_TYPES = 200  # largest number of types of one definition
_MAX_ELEMENTS = 1_000_000  # largest number of elements of a fixed array or bounded sequence
_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # rosbags' Nodetype


class BadDefinitionError(ValueError):
    """A message definition that is no valid one."""


def checked_types(types: Mapping[str, Any]) -> dict[str, Any]:
    """The types of a parsed definition without their constants, which messages do not hold.

    `types` are `{type name: (constants, [(field name, description)])}` as the type library parses them. Raises
    BadDefinitionError: a name is no identifier of ROS, a field is there twice, or a size is beyond reason.
    """
    if len(types) > _MAX_TYPES:
        raise BadDefinitionError(f"{len(types)} types in one definition")
    return {name: ([], _checked_fields(name, fields)) for name, (_, fields) in types.items()}


def is_valid(name: str, fields: Any) -> bool:
    """Whether `checked_types` accepts a type of these fields."""
    try:
        _checked_fields(name, fields)
    except BadDefinitionError:
        return False
    return True


def is_type_name(name: str) -> bool:
    """Whether a text is the full name of a message type: `package/msg/Type`."""
    return _TYPE_NAME.fullmatch(name) is not None


def _checked_fields(name: str, fields: Any) -> list[Any]:
    if not is_type_name(name):
        raise BadDefinitionError(f"{name!r} is no name of a type")
    if len(fields) > _MAX_FIELDS:
        raise BadDefinitionError(f"{name}: {len(fields)} fields")
    seen = set()
    for field, description in fields:
        plain = f"{field}_" if keyword.iskeyword(field) else field  # as the library names it
        if not _FIELD_NAME.fullmatch(field):
            raise BadDefinitionError(f"{name}: {field!r} is no name of a field")
        if plain in seen:
            raise BadDefinitionError(f"{name}: the field {field!r} is there twice")
        seen.add(plain)
        _check_description(name, description)
    return list(fields)


def _check_description(name: str, description: Any) -> None:
    kind, value = description
    kind = int(kind)
    if kind in (_ARRAY, _SEQUENCE):
        element, count = value
        if not isinstance(count, int) or not 0 <= count <= _MAX_ELEMENTS:
            raise BadDefinitionError(f"{name}: an array of {count} elements")
        if int(element[0]) not in (_BASE, _NAME):
            raise BadDefinitionError(f"{name}: an array of arrays")
        _check_description(name, element)
    elif kind == _BASE:
        base, limit = value
        if not _BASE_TYPE.fullmatch(base) or not isinstance(limit, int):
            raise BadDefinitionError(f"{name}: {base!r} is no type")
    elif kind == _NAME:
        if not is_type_name(value):
            raise BadDefinitionError(f"{name}: {value!r} is no type")
    else:
        raise BadDefinitionError(f"{name}: an unknown kind of field")
