"""Freed memory goes back to the system."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from gridslam.core import memory


@pytest.fixture
def trims(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The arguments with which glibc was asked to trim its heap."""
    asked: list[int] = []
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda name: SimpleNamespace(malloc_trim=asked.append))
    return asked


def test_glibc_is_asked_to_give_back_all(monkeypatch: pytest.MonkeyPatch, trims: list[int]) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    memory.return_freed_memory()
    assert trims == [0]


def test_on_other_systems_nothing_is_asked(monkeypatch: pytest.MonkeyPatch, trims: list[int]) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    memory.return_freed_memory()
    assert trims == []


def test_a_library_without_it_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    library = SimpleNamespace()
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda name: library)
    memory.return_freed_memory()
    assert vars(library) == {}
