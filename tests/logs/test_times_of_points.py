"""Times of a cloud's points in the units, under the names and by the clocks that drivers write."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gridslam.logs.codecs import cloud
from tests.logs.ros_samples import header, make

SIGNALLING_NAN = np.array([0x7F800001], np.uint32).view(np.float32)
STAMP_NS = 1_700_000_000_250_000_000
OFFSETS_S = np.linspace(0.0, 0.099, 100)
TYPES = {"i4": 5, "u4": 6, "f4": 7, "f8": 8}


def message(columns: dict[str, tuple[str, Any]], points: np.ndarray | None = None) -> Any:
    """sensor_msgs/PointCloud2 of 100 points with these columns, each a type and values, behind x, y, z."""
    layout = np.dtype([("x", "f4"), ("y", "f4"), ("z", "f4"), *((n, t) for n, (t, _) in columns.items())])
    rows = np.ones(100, layout)
    if points is not None:
        rows["x"], rows["y"], rows["z"] = points.T
    for name, (_, values) in columns.items():
        rows[name] = values
    fields = [
        make("sensor_msgs/msg/PointField", name=n, offset=layout.fields[n][1], datatype=TYPES[layout[n].str[1:]], count=1)
        for n in layout.names
    ]  # fmt: skip
    return make(
        "sensor_msgs/msg/PointCloud2", header=header(STAMP_NS), height=1, width=100, fields=fields,
        point_step=layout.itemsize, row_step=100 * layout.itemsize, data=np.frombuffer(rows.tobytes(), np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize(
    "columns",
    [
        {"t": ("u4", OFFSETS_S * 1e9)},
        {"t": ("u4", OFFSETS_S * 1e6)},
        {"time": ("f4", OFFSETS_S)},
        {"time": ("f4", OFFSETS_S * 1e3)},
        {"offset_time": ("f4", OFFSETS_S * 1e9)},
        {"stamps": ("f4", OFFSETS_S)},
        {"TimeOffset": ("f4", OFFSETS_S)},
        {"timestamp": ("f8", STAMP_NS * 1e-9 + OFFSETS_S)},
        {"timestamp": ("f8", STAMP_NS + OFFSETS_S * 1e9)},
        {"timestamp": ("f8", 18.0 + STAMP_NS * 1e-9 + OFFSETS_S)},  # of a clock with leap seconds
        {"timestamp": ("f8", 1234.5 + OFFSETS_S)},  # since the lidar was switched on
        {"timestamp": ("f8", 1e9 * (1234.5 + OFFSETS_S))},
        {"t": ("u4", 1e6 * (1234.5 + OFFSETS_S))},
        {
            "timestampSec": ("u4", np.full(100, STAMP_NS // 10**9)),
            "timestampNsec": ("u4", STAMP_NS % 10**9 + OFFSETS_S * 1e9),
        },
        {"timestamp": ("f8", (STAMP_NS + (OFFSETS_S * 1e9).astype(np.uint64)).astype(np.uint64).view(np.float64))},
    ],
)  # fmt: skip
def test_offsets_and_stamps_in_any_unit_and_by_any_clock_are_read(
    columns: dict[str, tuple[str, Any]],
) -> None:
    np.testing.assert_allclose(cloud.from_ros(message(columns), "").times_s, OFFSETS_S, atol=2e-6)


def test_times_before_a_stamp_at_the_end_are_negative() -> None:
    for columns in ({"time": ("f4", OFFSETS_S - 0.1)}, {"t": ("i4", (OFFSETS_S - 0.1) * 1e9)}):
        found = cloud.from_ros(message(columns), "").times_s
        np.testing.assert_allclose(found, OFFSETS_S - 0.1, atol=2e-6)


@pytest.mark.parametrize(
    "values",
    [
        np.full(100, 0.05),  # no sweep
        np.full(100, STAMP_NS * 1e-9),  # stamps that a float32 cannot hold
        np.linspace(0.0, 3e38, 100),
        np.random.default_rng(0).uniform(0.0, 4e9, 100),
    ],
)
def test_times_that_are_those_of_no_sweep_are_none(values: np.ndarray) -> None:
    assert len(cloud.from_ros(message({"time": ("f4", values)}), "").times_s) == 0


def test_points_that_are_no_returns_say_nothing_of_the_unit() -> None:
    points = np.ones((100, 3))
    points[10:20], points[30:40] = 0.0, np.nan
    times = STAMP_NS * 1e-9 + OFFSETS_S
    times[10:20], times[30:40] = 0.0, np.nan
    found = cloud.from_ros(message({"timestamp": ("f8", times)}, points), "")
    kept = np.delete(np.where(points[:, 0] == 0.0, 0.0, OFFSETS_S), slice(30, 40))
    np.testing.assert_allclose(found.times_s, kept, atol=2e-6)


@pytest.mark.parametrize("unusable", [SIGNALLING_NAN, [np.nan], [np.inf], [-np.inf]])
def test_times_that_are_no_numbers_are_kept_as_such_without_a_warning(unusable: Any) -> None:
    values = np.concatenate([np.asarray(unusable, np.float32), OFFSETS_S[1:].astype(np.float32)])
    found = cloud.from_ros(message({"time": ("f4", values)}), "")
    assert len(found.times_s) == 100
    assert cloud.unusable_reason(found) is not None
