"""Key scans in half the memory: what goes in comes out to single precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.lidar_slam import packed_scans
from gridslam.lidar_slam.packed_scans import PackedScans
from gridslam.lidar_slam.scans import PreparedScan

COUNTS = [(180, 150, 220), (0, 0, 0), (3, 2, 4), (500, 360, 900)]


def scan_of(stamp_ns: int, returns: int, points: int, surface: int) -> PreparedScan:
    rng = np.random.default_rng(stamp_ns)
    arrays = [rng.uniform(-80.0, 80.0, (n, 2)) for n in (returns, points, points, surface, surface)]
    return PreparedScan(stamp_ns, rng.uniform(size=2), *arrays)


@pytest.fixture
def scans() -> list[PreparedScan]:
    return [scan_of(stamp, *counts) for stamp, counts in enumerate(COUNTS)]


def packed(scans: list[PreparedScan]) -> PackedScans:
    found = PackedScans()
    for scan in scans:
        found.append(scan)
    return found


def test_every_array_comes_out_to_a_hundredth_of_a_millimetre(scans: list[PreparedScan]) -> None:
    found = packed(scans)
    assert len(found) == len(scans)
    for given, got in zip(scans, found, strict=True):
        assert got.stamp_ns == given.stamp_ns
        np.testing.assert_array_equal(got.viewpoint, given.viewpoint)
        for name in ("returns", "points", "normals", "surface", "surface_normals"):
            values = getattr(got, name)
            assert values.dtype == np.float64 and values.flags.c_contiguous
            np.testing.assert_allclose(values, getattr(given, name), rtol=0.0, atol=1e-5)


def test_scans_that_do_not_fit_a_block_begin_another(
    scans: list[PreparedScan], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = packed(scans)
    monkeypatch.setattr(packed_scans, "BLOCK_VALUES", 100)
    for a, b in zip(whole, packed(scans), strict=True):
        np.testing.assert_array_equal(a.surface, b.surface)


def test_they_are_a_sequence_like_any_other(scans: list[PreparedScan]) -> None:
    found = packed(scans)
    assert [scan.stamp_ns for scan in found[1:3]] == [1, 2]
    assert found[-1].stamp_ns == 3
    with pytest.raises(IndexError):
        found[4]


def test_points_that_are_part_of_the_surface_come_out_as_part_of_it(scans: list[PreparedScan]) -> None:
    given = replace(scans[0], points=scans[0].surface[::2], normals=scans[0].surface_normals[::2])
    got = packed([given])[0]
    np.testing.assert_array_equal(got.points, got.surface[::2])
    np.testing.assert_array_equal(got.normals, got.surface_normals[::2])


def test_points_whose_normals_are_others_than_on_the_surface_are_kept_beside_it(
    scans: list[PreparedScan],
) -> None:
    given = replace(scans[0], points=scans[0].surface[::2], normals=-scans[0].surface_normals[::2])
    np.testing.assert_allclose(packed([given])[0].normals, given.normals, rtol=0.0, atol=1e-5)
