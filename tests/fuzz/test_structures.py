"""A small dose of `tests.fuzz.many`."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import pytest

from tests.fuzz.structures import STRUCTURES

INPUTS = {
    "mcap": 6,
    "db3": 5,
    "csv": 5,
    "bag": 3,
    "h5": 8,
    "dataset": 8,
    "clf": 10,
    "foreign": 10,
    "table": 10,
    "run": 2,
}


@pytest.mark.parametrize("target", STRUCTURES)
def test_damaged_structures_end_in_a_result_or_an_error(tmp_path: Path, target: str) -> None:
    results = set()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in range(INPUTS.get(target, 20)):
            results.add(STRUCTURES[target](random.Random(f"{target} {seed}"), tmp_path))
    assert results


@pytest.mark.parametrize(
    ("target", "seed"),
    [
        ("mcap", 110156),  # wheels on the topic of a ranger's servo
        ("yaml", 100804),  # metadata without any recording
        ("map", 50644),  # a picture that says it has 2 GB
    ],
)
def test_inputs_that_were_bugs_are_none_any_more(tmp_path: Path, target: str, seed: int) -> None:
    """The target raises AssertionError where an input is handled wrongly."""
    assert STRUCTURES[target](random.Random(f"{target} {seed}"), tmp_path)
