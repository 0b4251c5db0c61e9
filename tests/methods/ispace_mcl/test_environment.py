"""The environment weight: what the fixed cameras say about poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.filters.particles import Particles
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.ispace_mcl.camera_config import CamerasConfig, DensityConfig, SightingConfig
from gridslam.methods.ispace_mcl.config import LikelihoodFieldConfig
from gridslam.methods.ispace_mcl.environment import (
    DensityWeight,
    Frame,
    SightingWeight,
    distance_to,
    in_cells,
    moving_cells,
    proposals,
)
from gridslam.methods.ispace_mcl.weighing import log_weight_of
from gridslam.sensors.fixed_camera import Sighting
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field
from tests.reference.kernel_density import density_at

CONFIG = CamerasConfig()
LEFT = 0.04  # the kernel is cut off at four deviations, where exp(-8) of it is left
COVERAGE = np.argwhere(np.ones((50, 50))) * 0.1 + 0.05  # 5 x 5 m


def frame(*places: tuple[float, float], back: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Frame:
    """A frame in which something moves at each of the places, which are centres of floor cells."""
    return Frame(np.array(places, np.float64).reshape(-1, 2), COVERAGE, np.array(back))


def test_a_sighting_speaks_for_what_is_near_against_what_is_elsewhere_in_view_and_not_about_the_rest() -> (
    None
):
    w = SightingConfig(frame_weight=1.0, radius_m=0.0)
    said = SightingWeight(CONFIG, w).log_likelihood(
        [frame((2.05, 2.05))],
        np.array([[2.05, 2.05, 0.0], [2.05, 2.35, 0.0], [4.55, 4.55, 0.0], [9.0, 9.0, 0.0]]),
    )
    peak = w.detection / (w.clutter_per_m2 * 2.0 * math.pi * w.bandwidth_m**2)
    assert said[0] == pytest.approx(math.log(1.0 - w.detection + peak))
    off = math.exp(-0.5 * (0.3 / w.bandwidth_m) ** 2)
    assert said[1] == pytest.approx(math.log(1.0 - w.detection + peak * off), abs=0.05)
    assert said[2] == pytest.approx(math.log(1.0 - w.detection), abs=LEFT)
    assert said[3] == pytest.approx(0.0, abs=LEFT)


def test_a_frame_without_anything_speaks_only_against_places_in_view() -> None:
    said = SightingWeight(CONFIG, SightingConfig()).log_likelihood(
        [frame()], np.array([[2.0, 2.0, 0.0], [8.0, 2.0, 0.0]])
    )
    assert said[0] < -0.5
    assert said[1] == pytest.approx(0.0, abs=LEFT)


def test_what_is_hidden_in_a_frame_counts_as_not_in_view() -> None:
    hidden = replace(frame(), in_view=COVERAGE[COVERAGE[:, 0] < 2.5])
    said = SightingWeight(CONFIG, SightingConfig()).log_likelihood(
        [hidden], np.array([[1.0, 1.0, 0.0], [4.0, 1.0, 0.0]])
    )
    assert said[0] < -0.5
    assert said[1] == pytest.approx(0.0, abs=LEFT)


def test_an_older_frame_is_about_where_the_robot_was_then() -> None:
    back = (-1.0, 0.0, 0.0)  # since then it drove a metre ahead
    said = SightingWeight(CONFIG, SightingConfig()).log_likelihood(
        [frame((1.05, 1.05), back=back)],
        np.array([[1.05, 2.05, np.pi / 2], [2.05, 1.05, 0.0], [1.05, 1.05, 0.0]]),
    )
    assert said[0] == pytest.approx(said[1])
    assert said[0] > said[2] + 1.0


def test_the_papers_weight_is_the_product_of_both_densities() -> None:
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(0.0, 4.0, (300, 2)), rng.uniform(-3, 3, 300)])
    weights = rng.random(300)
    weights /= weights.sum()
    places = [(1.05, 1.05), (3.05, 2.05), (3.15, 2.05)]
    config = DensityConfig(bandwidth_m=0.4)
    found = DensityWeight(config).reweighted([frame(*places)], Particles(poses, weights))
    seen = np.array([density_at(p[:2], places, [1.0] * 3, 0.4) for p in poses])
    assert found.weights == pytest.approx(weights * seen / (weights @ seen), abs=3e-4)

    as_printed = DensityConfig(bandwidth_m=0.4, onboard="kernel")
    found = DensityWeight(as_printed).reweighted([frame(*places)], Particles(poses, weights))
    onboard = np.array([density_at(p[:2], poses[:, :2].tolist(), weights.tolist(), 0.4) for p in poses])
    assert found.weights == pytest.approx(onboard * seen / (onboard @ seen), abs=3e-4)


def test_frames_of_different_moments_make_one_density() -> None:
    poses = np.array([[2.05, 1.05, 0.0], [1.05, 1.05, 0.0], [3.05, 3.05, 0.0]])
    frames = [frame((1.05, 1.05), back=(-1.0, 0.0, 0.0)), frame((3.05, 3.05))]
    found = DensityWeight(DensityConfig(bandwidth_m=0.2)).reweighted(frames, Particles.even(poses))
    assert found.weights == pytest.approx([0.5, 0.0, 0.5], abs=0.01)


def test_without_foreground_the_papers_weight_leaves_the_particles() -> None:
    particles = Particles.even(np.zeros((5, 3)))
    weight = DensityWeight(DensityConfig())
    assert weight.reweighted([frame()], particles) is particles
    assert weight.reweighted([frame((500.05, 0.05))], particles) is particles


def test_cells_with_little_surface_are_noise() -> None:
    points = np.array([[0.55, 0.55], [0.51, 0.59], [2.0, 2.0]])
    cells = moving_cells(Sighting(points, np.array([0.006, 0.006, 0.006]), np.ones(0, bool)), 0.1, 0.01)
    np.testing.assert_allclose(cells, [[0.55, 0.55]])


def test_distances_and_memberships_of_cells_agree_with_all_pairs() -> None:
    rng = np.random.default_rng(5)
    cells = (np.unique(rng.integers(-20, 20, (30, 2)), axis=0) + 0.5) * 0.1
    places = rng.uniform(-3.0, 3.0, (500, 2))
    centres = (np.floor(places / 0.1) + 0.5) * 0.1
    apart = np.hypot(*(centres[:, None] - cells).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(distance_to(cells, places, 0.1, 0.8), np.minimum(apart, 0.8), atol=1e-5)
    assert np.array_equal(in_cells(cells, places, 0.1), apart < 0.05)


def test_proposals_stand_where_something_moves_and_look_where_the_scan_fits() -> None:
    drawn = proposals(
        np.array([[1.05, 2.05], [4.05, 4.05]]),
        lambda poses: -20.0 * np.abs(poses[:, 2] - 1.0) - 10.0 * (poses[:, 0] > 3.0),
        400,
        np.random.default_rng(0),
    )
    assert drawn is not None
    assert np.median(drawn, axis=0) == pytest.approx([1.05, 2.05, 1.0], abs=0.1)
    assert proposals(np.zeros((0, 2)), lambda p: p[:, 0], 10, np.random.default_rng(0)) is None


def test_a_beam_that_ends_at_a_known_person_is_half_explained_and_others_are_as_before() -> None:
    occupied = np.zeros((100, 100), bool)
    occupied[:, 0] = True
    config = LikelihoodFieldConfig()
    weigh = log_weight_of(config, distance_field(occupied, GridGeometry(0.1, (0.0, 0.0)), 2.0), occupied)
    ends = np.array([[2.0, 0.0]])
    beam = Beams(np.array([2.0]), np.zeros(1), np.ones(1, bool), ends, np.zeros(3), 5.0, 0)
    poses = np.array([[4.0, 5.0, 0.0], [4.0, 8.0, 0.0], [2.05, 5.0, np.pi]])
    person = np.array([[6.05, 5.05]])
    worst = config.beam_weight * math.log(config.random_share)
    alone = weigh(beam, poses, np.zeros((0, 2)))
    known = weigh(beam, poses, person)
    assert alone == pytest.approx([worst, worst, 0.0], abs=0.03)
    assert known[0] == pytest.approx(0.5 * worst, abs=0.02)
    assert known[1:] == pytest.approx(alone[1:])
