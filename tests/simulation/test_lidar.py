"""Recorded noise is what the world file says; without noise every range is the analytic one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import LaserScan
from gridslam.simulation.driving.drive import STEP_S
from gridslam.simulation.simulator import Simulator
from tests.reference.segment_casting import cast_one
from tests.simulation.places import EXACT_LIDAR, recorded, room


def scans(count: int, **lidar: object) -> list[LaserScan]:
    settings = {**EXACT_LIDAR, "rate_hz": 100.0, "beams": 90, "field_of_view_deg": 90.0, **lidar}
    world = room(sensors={"lidar": settings})
    return [event for event in recorded(world, count) if isinstance(event, LaserScan)]


def exact_ranges(scan: LaserScan) -> np.ndarray:
    """Distances in the 8 x 5 m room from (3, 2), by trigonometry."""
    bearings = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
    with np.errstate(divide="ignore"):
        x = np.where(np.cos(bearings) > 0, 5.0, 3.0) / np.abs(np.cos(bearings))
        y = np.where(np.sin(bearings) > 0, 3.0, 2.0) / np.abs(np.sin(bearings))
    return np.minimum(x, y)


def test_without_noise_every_range_is_the_analytic_one() -> None:
    scan = scans(1, field_of_view_deg=360.0, beams=720)[0]
    assert np.abs(scan.ranges_m - exact_ranges(scan)).max() < 1e-6


def test_without_noise_every_range_of_a_moving_robot_among_furniture_is_the_analytic_one() -> None:
    lidar = {
        **EXACT_LIDAR,
        "sweep_s": 0.08,
        "rate_hz": 10.0,
        "beams": 60,
        "extrinsics": {"x": 0.2, "yaw_deg": 10},
    }
    world = room(
        sensors={"lidar": lidar},
        boxes=[{"centre": [6, 3.5], "size": [1, 0.5], "yaw_deg": 30}, {"centre": [1, 1], "size": [0.6, 0.6]}],
        cylinders=[{"centre": [5, 1], "radius_m": 0.3}],
        doors=[{"id": "d", "hinge": [0.02, 3], "closed_deg": 90, "opening_deg": -40}],
    )
    simulator = Simulator(world, Path())
    found = [event for _ in range(300) for event in simulator.step(4.0, 6.0)]
    scan = [event for event in found if isinstance(event, LaserScan)][-1]
    begun_s = (scan.stamp_ns - world.start_ns) * 1e-9
    segments = np.concatenate([simulator.scene.static_segments, simulator.scene.moving_segments])
    worst = 0.0
    for i, measured in enumerate(scan.ranges_m.tolist()):
        at = (begun_s + i * 0.08 / 59) / STEP_S
        before, after = simulator.robot.poses_at(np.array([int(at), int(at) + 1]) * STEP_S)
        x, y, yaw = before + (at - int(at)) * (after - before)
        bearing = yaw + np.radians(10) + scan.angle_min_rad + i * scan.angle_increment_rad
        ray = np.array([x + 0.2 * np.cos(yaw), y + 0.2 * np.sin(yaw), np.cos(bearing), np.sin(bearing)])
        worst = max(worst, abs(measured - cast_one(segments, simulator.scene.cylinders, ray, 25.0)))
    assert worst < 1e-6


def test_mean_and_variance_are_those_of_the_world_file() -> None:
    found = scans(
        300,
        noise_m=0.01,
        noise_per_m=0.002,
        bias_m=0.005,
        grazing_gain=0.0,
        tail_fraction=0.05,
        tail_scale=4.0,
    )
    exact = exact_ranges(found[0])
    errors = np.array([scan.ranges_m for scan in found]) - exact
    scaled = (errors - 0.005) / (0.01 + 0.002 * exact)
    n = scaled.size
    variance = 0.95 + 0.05 * 4.0**2
    assert abs(scaled.mean()) < 4 * np.sqrt(variance / n)
    fourth = 3 * (0.95 + 0.05 * 4.0**4)
    assert abs(scaled.var() - variance) < 4 * np.sqrt((fourth - variance**2) / n)
    beyond = np.mean(np.abs(scaled) > 5)  # 5 sigma: only readings of the tail, 21.1 % of them
    assert beyond == pytest.approx(0.05 * 0.2113, rel=0.2)


def test_noise_grows_with_the_angle_of_incidence() -> None:
    found = scans(300, noise_m=0.01, grazing_gain=0.5, beams=41, field_of_view_deg=60.0)
    errors = np.array([scan.ranges_m for scan in found]) - exact_ranges(found[0])
    slanted = np.cos(np.radians(60.0))  # the outermost beam meets the wall below
    assert errors[:, 20].std() == pytest.approx(0.01, rel=0.15)
    assert errors[:, 0].std() == pytest.approx(0.01 * (1 + 0.5 * (1 / slanted - 1)), rel=0.15)


def test_the_fractions_of_lost_readings_and_outliers_are_those_of_the_world_file() -> None:
    found = np.array([scan.ranges_m for scan in scans(300, dropout=0.03, outliers=0.02)])
    n = found.size
    exact = exact_ranges(scans(1)[0])
    assert abs(np.isinf(found).mean() - 0.03) < 4 * np.sqrt(0.03 * 0.97 / n)
    short = (found < exact - 1e-3).mean() / 0.97
    assert abs(short - 0.02) < 4 * np.sqrt(0.02 * 0.98 / n) + 0.02 * 1e-3


def test_mixed_pixels_lie_between_both_surfaces_and_only_at_edges() -> None:
    world = room(
        sensors={
            "lidar": {
                **EXACT_LIDAR,
                "rate_hz": 50.0,
                "beams": 1441,
                "mixing_probability": 0.5,
                "divergence_deg": 0.5,
            }
        },
        boxes=[{"centre": [5.5, 2], "size": [1, 1]}],
    )
    found = np.array([e.ranges_m for e in recorded(world, 200) if isinstance(e, LaserScan)])
    clean = room(
        sensors={"lidar": {**EXACT_LIDAR, "rate_hz": 50.0, "beams": 1441}},
        boxes=[{"centre": [5.5, 2], "size": [1, 1]}],
    )
    exact = next(e for e in recorded(clean, 2) if isinstance(e, LaserScan)).ranges_m
    changed = np.abs(found - exact) > 1e-5
    beams = np.flatnonzero(changed.any(axis=0))
    edge = np.arctan2(0.5, 2.0)
    bearings = -np.pi + np.arange(1441) * 2 * np.pi / 1441
    assert np.abs(np.abs(bearings[beams]) - edge).max() < np.radians(0.26)
    assert changed[:, beams].mean() == pytest.approx(0.5, abs=0.1)
    assert (found[:, beams] >= 2.0).all()
    assert (found[:, beams] <= 5.2).all()


def test_nothing_beyond_the_maximum_range_is_seen() -> None:
    scan = scans(1, range_max_m=4.0, field_of_view_deg=360.0)[0]
    exact = exact_ranges(scan)
    assert np.isinf(scan.ranges_m[exact > 4.0]).all()
    assert np.isfinite(scan.ranges_m[exact < 4.0]).all()


def test_stamps_are_late_and_jitter_as_the_world_file_says() -> None:
    found = scans(3000, latency_s=0.02, jitter_s=0.002, missing=0.1, beams=2)
    stamps = np.array([scan.stamp_ns for scan in found]) - 1_700_000_000_000_000_000
    late = (stamps - 10_000_000 * np.round((stamps - 20_000_000) / 1e7)) * 1e-9
    assert len(found) == pytest.approx(2700, abs=4 * np.sqrt(270))
    assert late.mean() == pytest.approx(0.02, abs=2e-4)
    assert late.std() == pytest.approx(0.002, rel=0.06)
    assert (np.diff(stamps) > 0).all()
