"""Freed memory goes back to the system."""

from __future__ import annotations

import sys

import pytest

from gridslam.core import memory


def test_it_may_be_called_at_any_time() -> None:
    memory.return_freed_memory()


def test_where_there_is_no_glibc_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda name: object())
    memory.return_freed_memory()
    monkeypatch.setattr(sys, "platform", "darwin")
    memory.return_freed_memory()
