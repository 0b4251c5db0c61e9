"""The sample logs of the repository are those that the simulator makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import LaserScan
from gridslam.logs import open_log
from gridslam.simulation.samples import SAMPLES, write_samples
from tests.conftest import REPOSITORY

FOLDER = REPOSITORY / "sample_logs"


def test_every_sample_is_there_with_its_truth_and_all_are_small() -> None:
    for sample in SAMPLES:
        assert (FOLDER / sample.name).exists()
        truth = FOLDER / f"{sample.name.removesuffix('.mcap')}.truth"
        tags = {"tags.yaml"} if sample.name == "slam-sd-tags.mcap" else set()
        assert {path.name for path in truth.iterdir()} == {
            "trajectory.tum", "map.pgm", "map.yaml", "objects.csv", "world.yaml", *tags,
        }  # fmt: skip
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 15_000_000


@pytest.mark.parametrize("name", ["slam-sd-tags", "ir-scan"])
def test_a_sample_made_anew_is_the_one_that_is_there(name: str, tmp_path: Path) -> None:
    write_samples(tmp_path, [f"{name}.mcap"])
    for made in (tmp_path / f"{name}.truth").iterdir():
        assert made.read_bytes() == (FOLDER / f"{name}.truth" / made.name).read_bytes(), made.name
    with open_log(tmp_path / f"{name}.mcap") as new, open_log(FOLDER / f"{name}.mcap") as old:
        pairs = list(zip(new.events(), old.events(), strict=True))
    assert len(pairs) > 1000
    for one, other in pairs:
        assert (type(one), one.stamp_ns) == (type(other), other.stamp_ns)
        if isinstance(one, LaserScan) and isinstance(other, LaserScan):
            assert np.array_equal(one.ranges_m, other.ranges_m)
