"""A small dose of tests/benchmarks/fuzz_logs.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.benchmarks.fuzz_logs import FUZZERS
from tests.logs.mutations import LogReading


@pytest.mark.parametrize("name", FUZZERS)
def test_a_damaged_log_is_read_as_far_as_it_goes_or_refused(tmp_path: Path, name: str) -> None:
    fuzzer: Callable[..., Iterator[LogReading]] = FUZZERS[name]
    readings = list(fuzzer(tmp_path, 40, seed=100))
    assert len(readings) >= 40
    assert any(reading.events for reading in readings)
    assert any(reading.is_lossy for reading in readings)
