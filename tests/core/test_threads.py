"""Threads are limited by the environment, which a library reads when a process first uses it: so each case is a process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from gridslam.core.threads import VARIABLES, drop_wrong_counts, threads_each

COUNT = """
from gridslam.core.threads import limit_threads
limit_threads(1)
import cv2
from gridslam.kernels import threads
print(cv2.getNumThreads(), threads._count)
"""


def test_a_limit_holds_for_numba_and_opencv() -> None:
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    done = subprocess.run(
        [sys.executable, "-c", COUNT], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "1"]


def test_what_the_user_has_set_is_kept_and_the_rest_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(VARIABLES[0], "7")
    with threads_each(3):
        assert [os.environ[name] for name in VARIABLES] == ["7", "3", "3", "3"]
    assert [name for name in VARIABLES if name in os.environ] == [VARIABLES[0]]


@pytest.mark.parametrize("value", ["abc", "0", "-1", "1.5", "99999", "\u0664", "", "9" * 50])
def test_a_variable_that_is_no_number_of_threads_is_removed_and_named(
    monkeypatch: pytest.MonkeyPatch, value: str
) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", value)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert drop_wrong_counts() == [f"NUMBA_NUM_THREADS={value}"]
    assert "NUMBA_NUM_THREADS" not in os.environ
    assert os.environ["OMP_NUM_THREADS"] == "3"


def test_a_number_of_threads_for_each_level_of_nesting_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    monkeypatch.setenv("OMP_NUM_THREADS", "4,2")
    assert drop_wrong_counts() == []
    monkeypatch.setenv("NUMBA_NUM_THREADS", "4,2")
    assert drop_wrong_counts() == ["NUMBA_NUM_THREADS=4,2"]
