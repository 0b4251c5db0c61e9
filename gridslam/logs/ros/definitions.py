"""Message definitions from files, checked before the type library generates code from them.

The library turns names of types and fields into Python source, so it only gets names with a strict pattern, and no constants.
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
_MAX_FIELDS_IN_ALL = 300  # largest number of fields of all types in a message; Odometry has 35
_MAX_TYPES = 200  # largest number of types of one definition
_MAX_ELEMENTS = 1_000_000  # largest number of elements of a fixed array or bounded sequence
# Largest number of structures and texts in all fixed arrays: the library generates some twenty lines of code for each
_MAX_UNROLLED = 100
_MAX_DEPTH = 20  # largest number of types within each other
_FILLER = "structure_needs_at_least_one_member"  # the field of types without fields; ROS 1 does not write it
BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4  # rosbags' Nodetype

Description = tuple[int, Any]
"""`(BASE, (type, length limit))`, `(NAME, type)`, or `(ARRAY or SEQUENCE, (description of an element, count))`."""
Types = dict[str, tuple[list[Any], list[tuple[str, Description]]]]
"""`{type name: (constants, [(field name, description)])}`, as the type library parses definitions."""


class BadDefinitionError(ValueError):
    """A message definition that is not valid."""


def checked_types(types: Mapping[str, Any]) -> dict[str, Any]:
    """The types of a parsed definition without their constants, which messages do not hold.

    `types` are `{type name: (constants, [(field name, description)])}` as the type library parses them. Raises
    BadDefinitionError: a name is not a ROS identifier, two fields have the same name, or a size is unreasonable.
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


def refuse_unbounded(types: Mapping[str, Any], name: str) -> None:
    """Raise BadDefinitionError for a message type whose generated code, or whose objects for a few bytes, have no bound.

    Such a type contains itself, is nested too deep, has too many fields or fixed arrays of structures in all, or contains
    structures without fields. `types` are those of `checked_types`; types that are missing there are not checked.
    """
    heights: dict[str, int] = {}
    _measure(types, name, heights)
    fields = [description for found in heights for _, description in types[found][1]]
    unrolled = sum(value[1] for kind, value in fields if kind == ARRAY and _holds_more_than_numbers(value[0]))
    if len(fields) > _MAX_FIELDS_IN_ALL or unrolled > _MAX_UNROLLED:
        raise BadDefinitionError(f"{name}: {len(fields)} fields, {unrolled} structures in fixed arrays")


def types_within(types: Mapping[str, Any], name: str) -> list[str]:
    """Names of all types in messages of a type, including its own, but without types that are missing."""
    found, remaining = dict[str, None](), [name]
    while remaining:
        one = remaining.pop()
        if one in types and one not in found:
            found[one] = None
            remaining += [_element(description)[1] for _, description in types[one][1]]
    return list(found)


def holds_lists_of_texts(types: Mapping[str, Any], name: str) -> bool:
    """Whether messages of a type contain sequences of strings, at any depth."""
    return any(
        kind == SEQUENCE and value[0][0] == BASE and "string" in value[0][1][0]
        for found in types_within(types, name)
        for _, (kind, value) in types[found][1]
    )


def _measure(types: Mapping[str, Any], name: str, heights: dict[str, int]) -> int:
    """The number of types within each other, from a type inwards; entered in `heights`, 0 while it is not known."""
    if name not in types:
        return 0
    if name in heights:
        if not heights[name]:
            raise BadDefinitionError(f"{name}: holds itself")
        return heights[name]
    heights[name] = 0
    inner = 0
    for _, description in types[name][1]:
        kind, value = _element(description)
        if kind == NAME:
            if value in types and all(field == _FILLER for field, _ in types[value][1]):
                raise BadDefinitionError(f"{name}: holds {value}, which has no fields")
            inner = max(inner, _measure(types, value, heights))
    if inner >= _MAX_DEPTH:
        raise BadDefinitionError(f"{name}: more than {_MAX_DEPTH} types within each other")
    heights[name] = inner + 1
    return inner + 1


def _element(description: Description) -> Description:
    """The description of an element of an array or sequence; that of anything else is its own."""
    element: Description = description[1][0] if description[0] in (ARRAY, SEQUENCE) else description
    return element


def _holds_more_than_numbers(element: Description) -> bool:
    return bool(element[0] == NAME or "string" in element[1][0])


def is_type_name(name: str) -> bool:
    """Whether a text is the full name of a message type: `package/msg/Type`."""
    return _TYPE_NAME.fullmatch(name) is not None


def _checked_fields(name: str, fields: Any) -> list[Any]:
    if not is_type_name(name):
        raise BadDefinitionError(f"{name!r} is not the name of a type")
    if len(fields) > _MAX_FIELDS:
        raise BadDefinitionError(f"{name}: {len(fields)} fields")
    seen = set()
    for field, description in fields:
        plain = f"{field}_" if keyword.iskeyword(field) else field  # as the library names it
        if not _FIELD_NAME.fullmatch(field):
            raise BadDefinitionError(f"{name}: {field!r} is not the name of a field")
        if plain in seen:
            raise BadDefinitionError(f"{name}: the field {field!r} is there twice")
        seen.add(plain)
        _check_description(name, description)
    return list(fields)


def _check_description(name: str, description: Any) -> None:
    kind, value = description
    kind = int(kind)
    if kind in (ARRAY, SEQUENCE):
        element, count = value
        if not isinstance(count, int) or not (kind == ARRAY) <= count <= _MAX_ELEMENTS:
            raise BadDefinitionError(f"{name}: an array of {count} elements")
        if int(element[0]) not in (BASE, NAME):
            raise BadDefinitionError(f"{name}: an array of arrays")
        _check_description(name, element)
    elif kind == BASE:
        base, limit = value
        if not _BASE_TYPE.fullmatch(base) or not isinstance(limit, int):
            raise BadDefinitionError(f"{name}: {base!r} is not a type")
    elif kind == NAME:
        if not is_type_name(value):
            raise BadDefinitionError(f"{name}: {value!r} is not a type")
    else:
        raise BadDefinitionError(f"{name}: an unknown kind of field")
