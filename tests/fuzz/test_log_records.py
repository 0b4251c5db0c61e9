"""A small dose of tests/fuzz/log_records.py."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.fuzz.log_records import MAKERS, check, write_sample


@pytest.mark.parametrize("kind", MAKERS)
def test_logs_with_damaged_records_are_read_and_converted_without_a_bug(tmp_path: Path, kind: str) -> None:
    sample = write_sample(tmp_path / ("sample" if kind == "csv" else "sample.mcap"))
    results = {
        check(MAKERS[kind](tmp_path / f"log.{kind}", sample, random.Random(seed)), tmp_path)
        for seed in range(8)
    }
    assert "read" in results
