"""Gates: bounds on measures, such as `--require 'ape.trans.rmse<=0.10'`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from gridslam.config.errors import nearest, short
from gridslam.core.errors import ConfigError
from gridslam.core.nested import flatten

Value: TypeAlias = float | int | bool | str | None

_OPERATORS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_GATE = re.compile(r"\s*([A-Za-z_][\w.]*)\s*(<=|>=|==|!=|<|>)\s*(\S+)\s*")
_TRUTH_VALUES = {"true": True, "false": False}


@dataclass(frozen=True, slots=True)
class Gate:
    """`key` `comparison` `bound`, for example ape.trans.rmse <= 0.1."""

    key: str
    comparison: str
    bound: float | bool

    def __str__(self) -> str:
        return f"{self.key}{self.comparison}{_text(self.bound)}"


def parse_gate(text: str) -> Gate:
    """The gate of a text: a key, a comparison, and a number, true or false. Raises ConfigError."""
    match = _GATE.fullmatch(text)
    if match is None:
        raise ConfigError(f"--require {short(text)}: expected KEY<=NUMBER (or >=, <, >, ==, !=)")
    key, comparison, word = match.groups()
    if word.lower() in _TRUTH_VALUES:
        if comparison not in ("==", "!="):
            raise ConfigError(f"--require {short(text)}: true and false are compared with == or !=")
        return Gate(key, comparison, _TRUTH_VALUES[word.lower()])
    try:
        bound = float(word)
    except ValueError:
        bound = math.nan
    if math.isnan(bound):
        raise ConfigError(f"--require {short(text)}: {short(word)} is neither a number nor true or false")
    return Gate(key, comparison, bound)


def measures_of(document: Mapping[str, Any]) -> dict[str, Value]:
    """The measures of a document by dotted key; lists are not measures."""
    return {key: value for key, value in flatten(document).items() if not isinstance(value, (list, tuple))}


def check_keys(gates: Sequence[Gate], document: Mapping[str, Any], needs: Mapping[str, str]) -> None:
    """Raise ConfigError for a key that is not in the document; `needs` says what the measures of a first part need."""
    flat = measures_of(document)
    for gate in gates:
        if gate.key in flat:
            continue
        part = gate.key.partition(".")[0]
        if part in needs and part not in document:
            raise ConfigError(f"--require {gate}: {part} is not measured; it needs {needs[part]}")
        raise ConfigError(f"--require {gate}: no measure {gate.key!r}{nearest(gate.key, flat)}")


def answers(gates: Sequence[Gate], document: Mapping[str, Any]) -> list[str]:
    """A line for each gate: the measure, the bound, and whether it holds."""
    flat = measures_of(document)
    return [
        f"{gate.key} {_short(flat[gate.key], gate)} {gate.comparison} {_text(gate.bound)}: "
        + ("holds" if _holds(gate, flat[gate.key]) else "fails")
        for gate in gates
    ]


def failures(gates: Sequence[Gate], document: Mapping[str, Any]) -> list[str]:
    """A line for each gate that fails. A measure without a value (NaN, null) fails every gate."""
    flat = measures_of(document)
    return [_failure(gate, flat[gate.key]) for gate in gates if not _holds(gate, flat[gate.key])]


def _holds(gate: Gate, value: Value) -> bool:
    if value is None or isinstance(value, str) or isinstance(value, bool) != isinstance(gate.bound, bool):
        return False
    return not math.isnan(value) and _OPERATORS[gate.comparison](value, gate.bound)


def _failure(gate: Gate, value: Value) -> str:
    bound = f"{gate.comparison} {_text(gate.bound)}"
    return f"gate failed: {gate.key} = {_text(value)}, required {bound}"


def _short(value: Value, gate: Gate) -> str:
    """A measure with three significant digits, or as many as show on which side of the bound it is."""
    if not isinstance(value, float) or not math.isfinite(value):
        return _text(value)
    texts = (f"{value:.{digits}g}" for digits in range(3, 18))
    return next((t for t in texts if _holds(gate, float(t)) == _holds(gate, value)), repr(value))


def _text(value: Value) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "no value"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.9g}" if isinstance(value, float) else str(value)
