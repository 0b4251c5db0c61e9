"""The examples of docs/formats.md are what they claim to be."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gridslam.config.yaml_file import parse_mapping
from gridslam.core.messages import Range, as_float32
from gridslam.logs import LogConfig, open_log
from gridslam.logs.csv.layout import CsvLayout
from gridslam.logs.kinds import CSV_KINDS
from gridslam.logs.skips import SkipReason

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
EXAMPLES = [
    parse_mapping(text, "docs/formats.md") for text in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
]


def test_every_example_is_valid() -> None:
    assert len(EXAMPLES) == 3
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
    config = LogConfig.model_validate(EXAMPLES[2]["log"])
    with open_log(data_dir / "infrared", config, ["range", "pose"]) as log:
        ranges = [e for e in log.events() if isinstance(e, Range)]
    assert len(ranges) == 2400
    assert {(r.range_min_m, r.range_max_m) for r in ranges} == {(as_float32(0.2), 8.0)}
