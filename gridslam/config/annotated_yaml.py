"""A configuration as YAML with the description, range and default of each key, as `gridslam config show` prints it."""

from __future__ import annotations

import functools
import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any, cast, get_args

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from gridslam.config.allowed_values import allowed_values

ADVANCED = "advanced"  # the section that the short form leaves out
INDENT = "  "
LINE_LENGTH = 110
COMMENT_COLUMN = 36
MAX_UNBROKEN = 60  # characters of notes that are not wrapped
UNBROKEN = "\0"  # stands for a space at which a line is not broken


def annotated_yaml(config: BaseModel, *, with_advanced: bool = False) -> str:
    """The YAML text of a configuration; the comment of a key is its description with `[allowed values; default]`.

    The default is omitted if it is the value shown. A key without a value is written as a comment, so that reading the text gives
    the same configuration. Without `with_advanced`, sections called `advanced` and the keys of entries of mappings and lists are
    omitted, and a last line says that they exist.
    """
    hidden: list[str] = []
    defaults = type(config).model_construct()
    lines = list(_section(config, defaults, "", "" if with_advanced else ADVANCED, hidden))
    if hidden:
        lines += ["", f"# {' and '.join(hidden)}: not shown; add --all"]
    return "\n".join(lines) + "\n"


def _section(
    config: BaseModel, defaults: BaseModel, path: str, skipped: str, hidden: list[str]
) -> Iterator[str]:
    """The lines of one section in the order of its model, `advanced` last; `defaults` is the section by default."""
    fields = type(config).model_fields
    indent = INDENT * path.count(".")
    for name in sorted(fields, key=lambda field: field == ADVANCED):
        value, default = getattr(config, name), getattr(defaults, name, None)
        if not isinstance(value, BaseModel):
            yield from _key(config, defaults, name, indent)
            if not skipped:
                yield from _entries(fields[name].annotation, indent, INDENT)
        elif name == skipped:
            hidden.append(f"{path}{name}")
        else:
            yield from _comment(_description(fields[name], value), indent)
            if not isinstance(default, type(value)):
                default = type(value).model_construct()
            below = list(_section(value, default, f"{path}{name}.", skipped, hidden))
            has_keys = any(not line.lstrip().startswith("#") for line in below)
            yield f"{indent}{name}:" if has_keys else f"{indent}{name}: {{}}"
            yield from below


def _key(config: BaseModel, defaults: BaseModel, name: str, indent: str) -> Iterator[str]:
    """One key with its value; a short comment is behind it, a long one above it."""
    value = _plain(config, name)
    line = f"{indent}# {name}:" if value is None else f"{indent}{name}: {_flow(value)}"
    default = _plain(defaults, name) if hasattr(defaults, name) else value
    comment = _with_notes(type(config), name, "" if default == value else _default(default))
    behind = f"{line:<{COMMENT_COLUMN}}  # {comment}"
    if comment and len(behind) <= LINE_LENGTH:
        yield behind
    else:
        yield from _comment(comment, indent)
        yield line


def _entries(annotation: Any, indent: str, depth: str) -> Iterator[str]:
    """Comments with the keys of the models that the entries of a mapping or a list, or an optional value, are made of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for name, field in annotation.model_fields.items():
            default = "" if field.is_required() else _default(field.get_default(call_default_factory=True))
            text = f"{field.alias or name}: {_with_notes(annotation, name, default)}"
            start = f"{indent}# {depth}"
            yield from textwrap.wrap(
                text, LINE_LENGTH, initial_indent=start, subsequent_indent=start + INDENT
            )
            yield from _entries(field.annotation, indent, depth + INDENT)
    else:
        for part in get_args(annotation):
            yield from _entries(part, indent, depth)


def _with_notes(model: type[BaseModel], name: str, default: str) -> str:
    """A key's description, and in brackets the values that it may have and its default."""
    values = allowed_values(_schemas(model)[name])
    notes = "; ".join(note for note in (values, default) if note)
    return " ".join(filter(None, [model.model_fields[name].description, f"[{notes}]" if notes else ""]))


@functools.cache
def _schemas(model: type[BaseModel]) -> Mapping[str, Any]:
    """JSON schema of each key of a model."""
    return cast("Mapping[str, Any]", model.model_json_schema(by_alias=False)["properties"])


def _default(value: Any) -> str:
    if value is None or isinstance(value, BaseModel):
        return "" if value else "default: absent"
    return f"default: {_flow(to_jsonable_python(value))}"


def _flow(value: Any) -> str:
    """The value as YAML on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, allow_unicode=True, width=math.inf)
    return text.removesuffix("...\n").rstrip("\n")


def _comment(text: str, indent: str) -> Iterator[str]:
    yield from _wrapped(text, f"{indent}# ", f"{indent}# ")


def _wrapped(text: str, start: str, next_start: str) -> Iterator[str]:
    """Lines of at most LINE_LENGTH; a short note in brackets at the end stays on one line."""
    body, bracket, notes = text.rpartition("[")
    if len(notes) < MAX_UNBROKEN:
        text = f"{body}{bracket}{notes.replace(' ', UNBROKEN)}"
    for line in textwrap.wrap(text, LINE_LENGTH, initial_indent=start, subsequent_indent=next_start):
        yield line.replace(UNBROKEN, " ")


def _description(field: FieldInfo, section: BaseModel) -> str:
    """A section's description, or else the first line of its model's docstring."""
    documented = (type(section).__doc__ or "").strip().split("\n")[0]
    return field.description or documented


def _plain(config: BaseModel, name: str) -> Any:
    """The value in the types that YAML has."""
    if getattr(config, name) is None:
        return None
    return config.model_dump(mode="json", include={name}, exclude_none=True)[name]
