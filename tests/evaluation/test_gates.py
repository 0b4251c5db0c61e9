from __future__ import annotations

import math

import pytest

from gridslam.core.errors import ConfigError
from gridslam.evaluation.gates import Gate, answers, check_keys, failures, parse_gate

DOCUMENT = {
    "ape": {"trans": {"rmse": 0.1, "max": math.nan}, "count": 5, "alignment": {"kind": "none"}},
    "localization": {"success": True},
}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("ape.trans.rmse<=0.1", True),
        ("ape.trans.rmse < 0.1", False),
        ("ape.trans.rmse>=1e-1", True),
        ("ape.count==5", True),
        ("ape.count!=5", False),
        ("ape.trans.max<=1e9", False),
        ("ape.trans.max!=0", False),
        ("ape.alignment.kind!=1", False),
        ("localization.success==true", True),
        ("localization.success==false", False),
        ("localization.success>=1", False),
    ],
)
def test_a_gate_holds_when_its_comparison_does_and_a_nan_never_does(text: str, holds: bool) -> None:
    assert (failures([parse_gate(text)], DOCUMENT) == []) is holds


def test_a_failure_names_value_and_bound() -> None:
    assert failures([Gate("ape.trans.rmse", "<=", 0.05)], DOCUMENT) == [
        "gate failed: ape.trans.rmse = 0.1, required <= 0.05"
    ]
    assert failures([Gate("ape.trans.max", "<=", 0.05)], DOCUMENT) == [
        "gate failed: ape.trans.max = no value, required <= 0.05"
    ]


@pytest.mark.parametrize("text", ["", "ape", "ape.trans.rmse", "x=1", "x<=y", "x<=nan", "x<=true", "x<=1 2"])
def test_text_that_is_no_gate_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="--require"):
        parse_gate(text)


def test_an_unknown_key_is_answered_with_the_nearest_and_a_missing_truth_with_the_option() -> None:
    with pytest.raises(ConfigError, match=r"did you mean 'ape\.trans\.rmse'"):
        check_keys([parse_gate("ape.trans.rsme<=1")], DOCUMENT, {})
    with pytest.raises(ConfigError, match="it needs --relations"):
        check_keys([parse_gate("relations.count>=1")], DOCUMENT, {"relations": "--relations"})


@pytest.mark.parametrize(
    ("gate", "value", "answer"),
    [
        ("ape<=0.10", 0.0187, "ape 0.0187 <= 0.1: holds"),
        ("ape<=0.1", 0.10004, "ape 0.10004 <= 0.1: fails"),
        ("ape<=0.1", math.nan, "ape no value <= 0.1: fails"),
        ("ape==true", True, "ape true == true: holds"),
        ("ape>=3", 2, "ape 2 >= 3: fails"),
    ],
)
def test_every_gate_is_answered_with_digits_that_show_why(gate: str, value: object, answer: str) -> None:
    assert answers([parse_gate(gate)], {"ape": value}) == [answer]
