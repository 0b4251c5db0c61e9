"""Documents whose values are drawn by their schema, and documents whose trees are changed."""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Iterator, Mapping
from typing import Any

ODD: tuple[Any, ...] = (
    None, True, -1, 0, 1, 3, 1e-12, 1e12, -1e300, 1e300, 5e-324, math.inf, math.nan, 2**31, 2**63, -(2**63) - 1, 10**400,
    "", "x", "1", "\x1b[31m", "../../x", "/dev/zero", "a" * 5000, "\ud800", [], [[]], {}, {"x": 1}, [1e300] * 3, [0] * 5000,
)  # fmt: skip
Place = tuple[str | int, ...]


def places(tree: Any, at: Place = ()) -> Iterator[Place]:
    """The places of all values in a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*at, key)
        yield from places(value, (*at, key))


def get(tree: Any, place: Place) -> Any:
    for key in place:
        tree = tree[key]
    return tree


def damaged(document: Any, rng: random.Random) -> Any:
    """A copy in which a few values are replaced, moved, repeated or left out."""
    document = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 2, 3))):
        every = list(places(document))
        if not every:
            break
        place = rng.choice(every)
        parent, key = get(document, place[:-1]), place[-1]
        what = rng.randrange(5)
        if what == 0:
            del parent[key]
        elif what == 1:
            parent[key] = copy.deepcopy(get(document, rng.choice(every)))
        elif what == 2 and isinstance(parent, dict):
            parent[rng.choice(("x", "", 1, None, str(key) + "s", "__class__"))] = parent.pop(key)
        elif what == 3 and isinstance(parent, list):
            parent[int(key) : int(key)] = [copy.deepcopy(parent[int(key)])] * rng.choice((1, 3, 300))
        else:
            parent[key] = number_near(parent[key], rng)
    return document


def number_near(value: Any, rng: random.Random) -> Any:
    """Something else than a value: for a number mostly one of another size."""
    if isinstance(value, bool) or not isinstance(value, int | float) or rng.random() < 0.3:
        return copy.deepcopy(rng.choice(ODD))  # or the next damage would change ODD
    factor = 10.0 ** rng.uniform(-12, 12) * rng.choice((1, 1, -1))
    scaled = float(value or 1) * factor if abs(value) < 1e280 else 0.0
    return round(scaled) if isinstance(value, int) else scaled


def drawn(
    document: dict[str, Any], schema: Mapping[str, Any], rng: random.Random, values: int
) -> dict[str, Any]:
    """A copy in which a few keys of the schema have drawn values, mostly allowed ones at or near a bound."""
    document = copy.deepcopy(document)
    for _ in range(values):
        node, part = document, dict(schema)
        while True:
            part = resolved(part, schema, rng)
            names = list(part.get("properties", {}))
            if not names:
                break
            name = rng.choice(names)
            below = resolved(part["properties"][name], schema, rng)
            if "properties" in below and isinstance(node.get(name, {}), dict):
                node[name] = node = node.get(name) or {}
                part = below
                continue
            node[name] = value_of(below, schema, rng)
            break
    return document


def at_bounds(document: dict[str, Any], schema: Mapping[str, Any], rng: random.Random) -> dict[str, Any]:
    """A copy in which several numbers of the schema are at their bounds, and as many near them."""
    document = copy.deepcopy(document)
    for _ in range(rng.choice((2, 4, 8, 20))):
        node, part = document, resolved(schema, schema, rng)
        while part.get("properties"):
            name = rng.choice(list(part["properties"]))
            part = resolved(part["properties"][name], schema, rng)
            if part.get("properties") and isinstance(node.get(name) or {}, dict):
                node[name] = node = node.get(name) or {}
                continue
            bounds = [
                part[b] for b in ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum") if b in part
            ]
            if bounds and part.get("type") in ("number", "integer"):
                bound = rng.choice(bounds)
                inside = bound * rng.choice((1.0, 1.001, 0.999)) or rng.choice((0.0, 1e-9))
                node[name] = round(inside) if part["type"] == "integer" else inside
            elif part.get("type") in ("boolean", "string"):
                node[name] = value_of(part, schema, rng)
            break
    return document


def resolved(part: Mapping[str, Any], schema: Mapping[str, Any], rng: random.Random) -> dict[str, Any]:
    """The part of a schema behind references; one of its alternatives."""
    part = dict(part)
    while True:
        options = part.get("anyOf") or part.get("oneOf")
        if "$ref" in part:
            part = dict(schema["$defs"][part["$ref"].rsplit("/", 1)[-1]])
        elif options:
            part = dict(rng.choice(options))
        else:
            return part


def value_of(part: Mapping[str, Any], schema: Mapping[str, Any], rng: random.Random, depth: int = 0) -> Any:
    """A value of a part of a schema; one in ten is an odd one."""
    if rng.random() < 0.1 or depth > 4:
        return copy.deepcopy(rng.choice(ODD))
    part = resolved(part, schema, rng)
    kind = part.get("type")
    if "const" in part or "enum" in part:
        return rng.choice(part.get("enum") or [part["const"]])
    if kind in ("number", "integer"):
        return _number(part, kind, rng)
    if kind == "array":
        items = part.get("prefixItems")
        if items:
            return [value_of(item, schema, rng, depth + 1) for item in items]
        limit = min(part.get("maxItems", 50), 50)
        count = rng.choice((0, part.get("minItems", 0), 1, 2, limit))
        return [value_of(part.get("items", {}), schema, rng, depth + 1) for _ in range(count)]
    if kind == "object":
        names = part.get("properties", {})
        chosen = [n for n in names if n in part.get("required", ()) or rng.random() < 0.2]
        return {name: value_of(names[name], schema, rng, depth + 1) for name in chosen}
    if kind == "boolean":
        return rng.random() < 0.5
    return None if kind == "null" else rng.choice(("", "a", "/scan", "laser", "odom", "\x1b[2J", "x" * 300))


def _number(part: Mapping[str, Any], kind: str, rng: random.Random) -> float | int:
    low = part.get("minimum", part.get("exclusiveMinimum"))
    high = part.get("maximum", part.get("exclusiveMaximum"))
    bounds = [b for b in (low, high) if b is not None]
    what = rng.randrange(4)
    if what == 0 and bounds:
        bound = rng.choice(bounds)
        step = rng.choice((-1, 0, 1))
        return (
            bound + step if kind == "integer" else math.nextafter(bound, step * math.inf) if step else bound
        )
    if what == 1 and len(bounds) == 2:
        value = rng.uniform(*bounds)
    else:
        value = 10.0 ** rng.uniform(-15, 15) * rng.choice((1, 1, 1, -1))
        if what == 3:
            value = rng.choice((0.0, 1e-300, 1e300, 2.0**31, 2.0**63, 1.0))
    return round(value) if kind == "integer" else value
