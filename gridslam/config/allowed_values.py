"""The values that a key may have, in words. They are derived from the JSON schema of its model, so that they match the checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ONE_SIDED = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}


def allowed_values(schema: Mapping[str, Any]) -> str:
    """The values that a JSON schema allows: `0 to 1`, `> 0, <= 1`, `each > 0`, `fast or exact`; empty if it allows any."""
    if "enum" in schema:
        return " or ".join(str(value) for value in schema["enum"])
    if "anyOf" in schema:
        present = [one for one in schema["anyOf"] if one.get("type") != "null"]
        return allowed_values(present[0]) if len(present) == 1 else ""
    items = schema.get("prefixItems") or [
        schema[key] for key in ("items", "additionalProperties") if schema.get(key)
    ]
    if items:
        of_items = {allowed_values(item) for item in items if isinstance(item, Mapping)}
        return f"each {text}" if len(of_items) == 1 and (text := of_items.pop()) else ""
    parts = []
    if "minimum" in schema and "maximum" in schema:
        low, high = _number(schema["minimum"]), _number(schema["maximum"])
        parts.append(low if low == high else f"{low} to {high}")
    else:
        parts += [f"{sign} {_number(schema[key])}" for key, sign in ONE_SIDED.items() if key in schema]
    if "multipleOf" in schema:
        parts.append(f"multiple of {_number(schema['multipleOf'])}")
    return ", ".join(parts)


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.12g}"
