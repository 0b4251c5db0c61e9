"""A configuration as YAML with each key's description beside it: what `gridslam config show` prints."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from typing import Any

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

ADVANCED = "advanced"  # the section that the short form leaves out
INDENT = "  "
LINE_LENGTH = 110
COMMENT_COLUMN = 36


def annotated_yaml(config: BaseModel, *, with_advanced: bool = False) -> str:
    """The YAML text of a configuration; every key carries its description as a comment.

    A key without a value is written as a comment, so that the text read back gives the same configuration. Sections called
    `advanced` are left out unless `with_advanced` is true; a last line then says that they exist.
    """
    hidden: list[str] = []
    lines = list(_section(config, "", "" if with_advanced else ADVANCED, hidden))
    if hidden:
        lines += ["", f"# {' and '.join(hidden)}: not shown; add --all"]
    return "\n".join(lines) + "\n"


def _section(config: BaseModel, path: str, skipped: str, hidden: list[str]) -> Iterator[str]:
    """The lines of one section in the order of its model, `advanced` last."""
    fields = type(config).model_fields
    indent = INDENT * path.count(".")
    for name in sorted(fields, key=lambda field: field == ADVANCED):
        value = getattr(config, name)
        if not isinstance(value, BaseModel):
            yield from _key(name, _plain(config, name, value), fields[name], indent)
        elif name == skipped:
            hidden.append(f"{path}{name}")
        else:
            yield from _comment(_description(fields[name], value), indent)
            below = list(_section(value, f"{path}{name}.", skipped, hidden))
            has_keys = any(not line.lstrip().startswith("#") for line in below)
            yield f"{indent}{name}:" if has_keys else f"{indent}{name}: {{}}"
            yield from below


def _key(name: str, value: Any, field: FieldInfo, indent: str) -> Iterator[str]:
    """One key with its value; the comment stands behind it where it is short, and above it where it is long."""
    line = f"{indent}# {name}:" if value is None else f"{indent}{name}: {_flow(value)}"
    comment = field.description or ""
    behind = f"{line:<{COMMENT_COLUMN}}  # {comment}"
    if comment and len(behind) <= LINE_LENGTH:
        yield behind
    else:
        yield from _comment(comment, indent)
        yield line


def _flow(value: Any) -> str:
    """The value as YAML on one line."""
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, allow_unicode=True, width=math.inf)
    return text.removesuffix("...\n").rstrip("\n")


def _comment(text: str, indent: str) -> Iterator[str]:
    if text:
        for line in textwrap.wrap(text, LINE_LENGTH - len(indent) - 2):
            yield f"{indent}# {line}"


def _description(field: FieldInfo, section: BaseModel) -> str:
    """A section's description, or else the first line of its model's docstring."""
    documented = (type(section).__doc__ or "").strip().split("\n")[0]
    return field.description or documented


def _plain(config: BaseModel, name: str, value: Any) -> Any:
    """The value in the types that YAML has."""
    if value is None:
        return None
    return config.model_dump(mode="json", include={name}, exclude_none=True)[name]
