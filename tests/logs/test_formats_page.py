"""The examples of the pages about logs are what they claim to be."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from gridslam.config.yaml_file import parse_mapping
from gridslam.core.messages import LaserScan, Odometry, Range, as_float32
from gridslam.logs import LogConfig, open_log
from gridslam.logs.csv_layout import CsvLayout
from gridslam.logs.kinds import CSV_KINDS
from gridslam.logs.skips import SkipReason
from tests.conftest import REPOSITORY

PAGE, LAYOUTS = ((REPOSITORY / "docs" / name).read_text() for name in ("formats.md", "log-layouts.md"))
EXAMPLES = [
    parse_mapping(text, "docs") for text in re.findall(r"```yaml\n(.*?)```", PAGE + LAYOUTS, re.DOTALL)
]


def test_every_example_is_valid() -> None:
    assert len(EXAMPLES) == 5
    for example in EXAMPLES:
        if "log" in example:
            LogConfig.model_validate(example["log"])
        else:
            CsvLayout.model_validate(example)


def test_the_log_section_shows_every_key() -> None:
    assert set(EXAMPLES[0]["log"]) == set(LogConfig.model_fields)


def test_the_table_of_streams_has_every_kind_with_its_columns() -> None:
    for kind in (*CSV_KINDS, "stereo"):
        (row,) = [line for line in PAGE.splitlines() if re.match(rf"\| `?{kind}`? \|", line)]
        for column in () if kind in ("stereo", "camera_info") else CSV_KINDS[kind].required:
            assert re.search(rf"\b{column}\b", row), (kind, column)


def test_every_reason_for_skipping_a_message_is_on_the_page() -> None:
    for reason in SkipReason:
        assert f"`{reason.value}`" in PAGE


@pytest.mark.real_data
def test_the_infrared_example_reads_the_infrared_log(data_dir: Path) -> None:
    config = LogConfig.model_validate(EXAMPLES[3]["log"])
    with open_log(data_dir / "infrared", config, ["range", "pose"]) as log:
        ranges = [e for e in log.events() if isinstance(e, Range)]
    assert len(ranges) == 2400
    assert {(r.range_min_m, r.range_max_m) for r in ranges} == {(as_float32(0.2), 8.0)}


def test_the_example_of_a_table_with_everything_in_one_row_reads_it(tmp_path: Path) -> None:
    head = "t_ms;x_mm;y_mm;heading_deg;" + ";".join(f"d{k}" for k in range(241))
    rows = [f"{1000 + 100 * k};{50 * k};0;{k};0;" + ";".join(["2500"] * 240) for k in range(5)]
    (tmp_path / "run.csv").write_text("\n".join([head, *rows]))
    config = LogConfig.model_validate(EXAMPLES[2]["log"])
    with open_log(tmp_path, config, ["scan", "odom"]) as log:
        events = list(log.events())
    scan = [e for e in events if isinstance(e, LaserScan)][1]
    odometry = [e for e in events if isinstance(e, Odometry)][1]
    assert scan.stamp_ns == odometry.stamp_ns == 1_100_000_000
    assert len(scan.ranges_m) == 241 and np.isnan(scan.ranges_m[0]) and scan.ranges_m[1] == 2.5
    last_rad = scan.angle_min_rad + 240 * scan.angle_increment_rad
    assert (scan.range_max_m, last_rad) == pytest.approx((8.0, math.radians(120)), abs=1e-5)
    assert (odometry.x_m, odometry.yaw_rad) == pytest.approx((0.05, math.radians(1)))
