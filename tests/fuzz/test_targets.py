"""The fuzzer's own ground: it begins with good input, and notices a bug."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz import targets

OF_PARTS = {"mcap", "drawing", "yaml"}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    targets.scratch.cache_clear()
    yield
    targets.scratch.cache_clear()


@pytest.mark.parametrize("name", sorted(set(targets.TARGETS) - OF_PARTS))
def test_a_seed_is_accepted(name: str) -> None:
    for seed in targets.seeds_of(name):
        assert targets.check(name, seed)


@pytest.mark.parametrize("name", sorted(OF_PARTS))
def test_no_seed_of_parts_is_a_bug_and_some_are_accepted(name: str) -> None:
    answers = [targets.check(name, seed) for seed in targets.seeds_of(name)]
    assert any(answers)


def test_anything_but_a_gridslam_error_is_a_bug(monkeypatch: pytest.MonkeyPatch) -> None:
    def divides(data: bytes) -> float:
        return 1 / len(data)

    monkeypatch.setattr(targets, "TARGETS", {"divides": divides})
    targets.check("divides", b"x")
    with pytest.raises(ZeroDivisionError):
        targets.check("divides", b"")
