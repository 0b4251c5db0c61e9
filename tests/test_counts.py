from __future__ import annotations

import ast

import pytest

from tests.conftest import REPOSITORY
from tests.counts import counted, functions, parameters, positional_calls

LARGEST = {  # lower them with the counts
    "calls with more than 5 positional arguments": 3,
    "functions with more than 6 parameters": 58,
    "functions of more than 60 lines": 0,
    "files of more than 250 lines": 24,
}


def test_what_makes_code_hard_to_read_does_not_grow() -> None:
    found = counted(REPOSITORY)
    assert {name: found[name] for name in LARGEST if found[name] > LARGEST[name]} == {}  # type: ignore[operator]


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        ("f(1, 2, 3, 4, 5, 6)", 1),
        ("f(1, 2, 3, 4, 5, six=6)", 0),
        ("cv2.line(1, 2, 3, 4, 5, 6)", 0),
        ("f(1, 2, 3, 4, 5, *six)", 0),
    ],
)
def test_calls_by_position_are_counted(call: str, expected: int) -> None:
    assert positional_calls(call) == expected


def test_parameters_that_a_caller_gives_are_counted() -> None:
    (function,) = functions("class A:\n    def f(self, a, /, b, *args, c=1): ...")
    assert isinstance(function, ast.FunctionDef)
    assert parameters(function) == 3
