from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.benchmarks.harness import HERE, Row, bounded, read_bounds, table


def test_a_bound_holds_from_both_sides() -> None:
    assert Row("t", 1.0, "s", bound=1.0).holds
    assert not Row("t", 1.1, "s", bound=1.0).holds
    assert Row("r", 5.0, "1/s", bound=4.0, at_least=True).holds
    assert not Row("r", 3.0, "1/s", bound=4.0, at_least=True).holds
    assert Row("x", 3.0, "m").holds
    assert not Row("x", math.nan, "m").holds


def test_the_file_sets_bounds_by_name() -> None:
    row = bounded(Row("a.rate", 3.0, "1/s"), {"a.rate": {"at_least": 4}})
    assert (row.bound, row.at_least, row.holds) == (4.0, True, False)
    assert "BROKEN" in table([row])


def test_a_malformed_bound_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "bounds.yaml"
    file.write_text("a: 3\n")
    with pytest.raises(ValueError, match="at_most"):
        read_bounds(file)


def test_the_stored_bounds_are_well_formed() -> None:
    assert read_bounds(HERE / "bounds.yaml")
