from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.beam_model import BeamMixture, BeamModel, beam_table, range_difference_log_likelihood
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.range_caster import range_caster

MIXTURE = BeamMixture(sigma_m=0.2, hit=0.7, short=0.1, max=0.1, random=0.1, short_decay_per_m=0.3, bin_m=0.05)
GEOMETRY = GridGeometry(0.05, (0.0, 0.0))


def _room():
    """A room of 6 m x 4 m with walls of one cell."""
    occupied = np.zeros((80, 120), bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    return occupied


def _beams(ranges, bearings, max_range_m=5.0):
    ranges, bearings = np.array(ranges), np.array(bearings)
    returned = ranges < max_range_m
    points = (np.stack([np.cos(bearings), np.sin(bearings)], axis=1) * ranges[:, None])[returned]
    return Beams(
        ranges=ranges,
        bearings=bearings,
        returned=returned,
        points=points,
        extrinsics=np.zeros(3),
        max_range_m=max_range_m,
        unreadable=0,
    )


def test_every_column_of_the_table_is_a_distribution():
    table = np.exp(beam_table(MIXTURE, 5.0).astype(np.float64))
    np.testing.assert_allclose(table.sum(axis=0), 1.0, atol=1e-5)


def test_the_table_has_the_four_parts_of_the_mixture():
    table = np.exp(beam_table(MIXTURE, 5.0).astype(np.float64))
    expected, last = 60, 100  # a wall at 3 m, a maximum range of 5 m
    density = 1.0 / (0.2 * math.sqrt(2.0 * math.pi)) * 0.05
    assert table[expected, expected] == pytest.approx(0.7 * density + 0.1 * 0.05 / 5.0, rel=0.02)
    shorts = 0.1 * 0.3 * math.exp(-0.3 * 1.0) * 0.05 / (1.0 - math.exp(-0.3 * 3.0))
    assert table[20, expected] == pytest.approx(shorts + 0.1 * 0.05 / 5.0, rel=0.02)
    assert table[80, expected] == pytest.approx(0.1 * 0.05 / 5.0, rel=0.02)
    assert table[last, expected] == pytest.approx(0.1, rel=0.02)
    assert table[last, last] == pytest.approx(0.8, rel=0.02)


def test_the_true_pose_is_the_likeliest():
    caster = range_caster(_room(), GEOMETRY)
    bearings = np.linspace(-3.0, 3.0, 40)
    truth = np.array([[2.0, 1.5, 0.4]])
    ranges = caster.ranges(truth, bearings, np.zeros(3), 5.0)[0].astype(np.float64)
    beams = _beams(ranges, bearings)
    others = truth + np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, -0.5, 0.0], [0.0, 0.0, 0.3]])
    for scores in (
        BeamModel(caster, MIXTURE).log_likelihood(beams, others),
        range_difference_log_likelihood(caster, beams, others, 0.5),
    ):
        assert scores.argmax() == 0


def test_the_range_difference_is_the_mean_square_over_the_beams():
    caster = range_caster(_room(), GEOMETRY)
    # From the middle of the room the walls' faces are 2.95 m ahead and behind and 1.95 m to the sides.
    beams = _beams([2.95, 1.95, 2.45, 5.0], [0.0, math.pi / 2, math.pi, -math.pi / 2])
    score = range_difference_log_likelihood(caster, beams, np.array([[3.0, 2.0, 0.0]]), 0.5)
    assert score[0] == pytest.approx(-0.5 / 0.25 * (0.5**2 + 3.05**2) / 4, rel=1e-4)


def test_expected_ranges_are_at_most_the_maximum_range():
    caster = range_caster(_room(), GEOMETRY)
    ranges = caster.ranges(np.array([[1.0, 2.0, 0.0]]), np.array([0.0, math.pi]), np.zeros(3), 3.0)
    np.testing.assert_allclose(ranges[0], [3.0, 0.95], atol=1e-5)


def test_rays_start_at_the_sensor():
    caster = range_caster(_room(), GEOMETRY)
    extrinsics = np.array([0.5, 0.0, math.pi / 2])
    ranges = caster.ranges(np.array([[3.0, 2.0, math.pi / 2]]), np.zeros(1), extrinsics, 10.0)
    assert ranges[0, 0] == pytest.approx(2.95, abs=1e-5)
