"""Settings of all built-in methods and of logs: few, and `config show` says meaning, unit, range and effect of each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args

import pytest
from pydantic import BaseModel

from gridslam.config.allowed_values import allowed_values
from gridslam.methods import registry
from gridslam.methods.registry import BUILT_IN
from gridslam.runs.run_config import RunConfig

MAX_KEYS = 15
# By the end of a key's name; the others name their unit in words, or are counts and ratios.
UNITS = {
    "_mps": "m/s",
    "_radps": "rad/s",
    "_per_m": "per metre",
    "_per_rad": "per rad",
    "_per_m2": "per m2",
    "_per_m_rad": "rad",
    "_m": "metres",
    "_rad": "rad",
    "_px": "px",
    "_s": "seconds",
    "_deg": "degrees",
    "disparities": "px",
    "_mb": "MB|MiB",
    "_fraction": "fraction",
    "_ratio": "ratio|fraction",
    "_probability": "probability",
}
WITHOUT_SUFFIX = "number|correlation|probability|fraction|log likelihood ratio|exponent|strength|in \\w+\\^2/"
# Facts of the robot, the log or the place, which are measured and not tuned: raising them has no purpose.
FACTS = (
    r"seed|start|sweep_s|start_s|end_s|period_s|wheel_(radius|base)_m|x|y|z|yaw|roll|pitch|quat_wxyz|version|invalid_from"
    r"|field_of_view_deg|range_max_m|position|facing_deg|hinge|closed_pose|footprint|invalid"
)
EFFECT = re.compile(r"\b([Rr]aise|[Ll]ower) (it|them)\b")


class Key(NamedTuple):
    path: str
    description: str
    range: str
    is_number: bool
    is_leaf: bool  # of the sections themselves, not of what a mapping or a list consists of


def keys_of(model: type[BaseModel], path: str = "", is_leaf: bool = True) -> Iterator[Key]:
    """All settings of a model, those of its sections, and those of the models in its mappings and lists."""
    schema = model.model_json_schema(by_alias=False)["properties"]
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from keys_of(field.annotation, f"{path}{name}.", is_leaf)
            continue
        kinds = set(parts_of(field.annotation))
        numbers = bool({int, float} & kinds) and not {str, dict} & kinds
        yield Key(path + name, field.description or "", allowed_values(schema[name]), numbers, is_leaf)
        for below in kinds:
            if issubclass(below, BaseModel):
                yield from keys_of(below, f"{path}{name}.", is_leaf=False)


def parts_of(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and not get_args(annotation):
        yield annotation
    for part in get_args(annotation):
        yield from parts_of(part)


METHOD_KEYS = {
    name: [key for key in keys_of(registry.load(entry.config)) if key.path != "name"]
    for name, entry in BUILT_IN.items()
}
LOG_KEYS = [
    key
    for section in ("log", "output", "made_with")
    for field in [RunConfig.model_fields[section]]
    for model in parts_of(field.annotation)
    if issubclass(model, BaseModel)
    for key in keys_of(model, f"{section}.")
]
ALL_KEYS = {"log": LOG_KEYS, **METHOD_KEYS}


@pytest.mark.parametrize("method", BUILT_IN)
def test_a_method_has_at_most_15_keys_and_15_advanced_ones(method: str) -> None:
    keys = [key.path for key in METHOD_KEYS[method] if key.is_leaf]
    advanced = [key for key in keys if key.startswith("advanced.")]
    assert len(advanced) <= MAX_KEYS
    assert len(keys) - len(advanced) <= MAX_KEYS


@pytest.mark.parametrize("part", ALL_KEYS)
def test_every_key_is_described_in_sentences(part: str) -> None:
    fragments = [
        key.path
        for key in ALL_KEYS[part]
        if not re.match(r"[A-Z`\[]|\w[\w ,]*: \w", key.description) or not key.description.endswith(".")
    ]
    assert fragments == []


@pytest.mark.parametrize("part", ALL_KEYS)
def test_every_number_has_a_unit_a_range_and_an_effect(part: str) -> None:
    numbers = [key for key in ALL_KEYS[part] if key.is_number]
    tuned = [key for key in numbers if not re.fullmatch(FACTS, key.path.rpartition(".")[2])]
    assert [key.path for key in tuned if not key.range] == []
    assert [key.path for key in tuned if not EFFECT.search(key.description)] == []
    assert [
        key.path for key in numbers if not re.search(unit_of(key.path), key.description, re.IGNORECASE)
    ] == []


def unit_of(path: str) -> str:
    """A pattern of the words for a key's unit, by its name."""
    if re.fullmatch(r"seed|version|quat_wxyz|invalid(_from)?", path.rpartition(".")[2]):
        return ""
    ending = max((end for end in UNITS if path.endswith(end)), key=len, default="")
    return UNITS.get(ending, f"{WITHOUT_SUFFIX}|metres|\\(m\\)|drawing units|rad\\b")
