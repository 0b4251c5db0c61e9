"""The environment weight: weights of poses by the observations of fixed cameras."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.filters.particles import Particles
from gridslam.maps.occupancy import GridGeometry
from gridslam.methods.ispace_mcl.cameras.environment import (
    CameraObservation,
    DensityWeight,
    DetectionLikelihood,
    DetectionWeight,
    ObservedTrack,
    distance_to_cells,
    is_in_cells,
    moving_cells,
)
from gridslam.methods.ispace_mcl.weighing import FIELD_BEAM_WEIGHT, RANDOM_WEIGHT, log_weight_of
from gridslam.sensors.fixed_camera import FloorDetections
from gridslam.sensors.floor_cells import FloorCells
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field
from tests.reference.kernel_density import density_at

CELL_M = 0.1
CUT = 0.04  # the kernel is cut off at four standard deviations, where exp(-8) of it remains
COVERAGE = FloorCells(np.argwhere(np.ones((50, 50))), CELL_M)  # 5 x 5 m


def frame(
    *cells: tuple[float, float], then: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> CameraObservation:
    """An observation with moving objects at the given centres of floor cells."""
    moving = FloorCells.containing(np.array(cells, np.float64).reshape(-1, 2), CELL_M)
    return CameraObservation(moving, COVERAGE, np.array(then))


def test_a_detection_favours_poses_near_it_over_other_poses_in_view_and_leaves_the_rest() -> None:
    w = DetectionLikelihood(frame_weight=1.0, radius_m=0.0)
    found = DetectionWeight(w).log_likelihood(
        [frame((2.05, 2.05))],
        np.array([[2.05, 2.05, 0.0], [2.05, 2.35, 0.0], [4.55, 4.55, 0.0], [9.0, 9.0, 0.0]]),
    )
    peak = w.detection / (w.clutter_per_m2 * 2.0 * math.pi * w.bandwidth_m**2)
    assert found[0] == pytest.approx(math.log(1.0 - w.detection + peak))
    off = math.exp(-0.5 * (0.3 / w.bandwidth_m) ** 2)
    assert found[1] == pytest.approx(math.log(1.0 - w.detection + peak * off), abs=0.05)
    assert found[2] == pytest.approx(math.log(1.0 - w.detection), abs=CUT)
    assert found[3] == pytest.approx(0.0, abs=CUT)


def test_a_frame_without_detections_only_lowers_poses_in_view() -> None:
    found = DetectionWeight().log_likelihood([frame()], np.array([[2.0, 2.0, 0.0], [8.0, 2.0, 0.0]]))
    assert found[0] < -0.5
    assert found[1] == pytest.approx(0.0, abs=CUT)


def test_hidden_cells_count_as_out_of_view() -> None:
    hidden = replace(frame(), in_view=COVERAGE.select(COVERAGE.centres[:, 0] < 2.5))
    found = DetectionWeight().log_likelihood([hidden], np.array([[1.0, 1.0, 0.0], [4.0, 1.0, 0.0]]))
    assert found[0] < -0.5
    assert found[1] == pytest.approx(0.0, abs=CUT)


def test_an_older_frame_is_compared_with_the_past_position() -> None:
    then = (-1.0, 0.0, 0.0)  # since then it drove a metre ahead
    found = DetectionWeight().log_likelihood(
        [frame((1.05, 1.05), then=then)],
        np.array([[1.05, 2.05, np.pi / 2], [2.05, 1.05, 0.0], [1.05, 1.05, 0.0]]),
    )
    assert found[0] == pytest.approx(found[1])
    assert found[0] > found[2] + 1.0


def test_an_object_that_moved_otherwise_than_the_robot_is_a_person() -> None:
    """The robot drives ahead by half a metre between frames; an object comes towards it, another stands."""
    back = [np.array([-0.5 * k, 0.0, 0.0]) for k in (1, 2, 3)]

    def at(x: float) -> FloorCells:
        return FloorCells.containing(np.array([[x, 2.05]]), CELL_M)

    def log_likelihood(speed: float) -> float:
        past = tuple((then, at(2.05 - speed * (k + 1))) for k, then in enumerate(back))
        seen = replace(frame((2.05, 2.05)), tracks=(ObservedTrack(at(2.05), past, was_expected=True),))
        return float(DetectionWeight().log_likelihood([seen], np.array([[2.05, 2.05, 0.0]]))[0])

    unseen = float(DetectionWeight().log_likelihood([frame()], np.array([[2.05, 2.05, 0.0]]))[0])
    new = float(DetectionWeight().log_likelihood([frame((2.05, 2.05))], np.array([[2.05, 2.05, 0.0]]))[0])
    assert 0.5 < log_likelihood(0.5) < new  # a tracked object was to be expected there
    assert unseen < log_likelihood(-0.5) < 0.0
    assert log_likelihood(0.0) < 0.0


def test_a_person_for_whom_the_robot_was_taken_is_the_robot_again_after_some_frames() -> None:
    """The robot drives ahead; the object of its track came towards it until `frames` frames ago."""

    def log_likelihood(frames: int) -> float:
        past = tuple(
            (np.array([-0.5 * k, 0.0, 0.0]), FloorCells.containing(np.array([[x, 2.05]]), CELL_M))
            for k, x in enumerate([2.05 - 0.5 * k if k <= frames else 4.05 for k in range(1, 9)], start=1)
        )
        seen = replace(frame((2.05, 2.05)), tracks=(ObservedTrack(frame((2.05, 2.05)).moving, past, True),))
        return float(DetectionWeight().log_likelihood([seen], np.array([[2.05, 2.05, 0.0]]))[0])

    by_frames = [log_likelihood(frames) for frames in range(9)]
    assert by_frames[0] < by_frames[1] < by_frames[2] < by_frames[3] < by_frames[4]
    assert by_frames[0] < 0.0 < by_frames[4]
    assert by_frames[4] == pytest.approx(by_frames[8])


def test_an_observation_seen_from_a_later_scan_has_the_robot_farther_back() -> None:
    past = ((np.array([-1.0, 0.0, 0.0]), frame((1.05, 2.05)).moving),)
    seen = replace(frame((2.05, 2.05)), tracks=(ObservedTrack(frame((2.05, 2.05)).moving, past),))
    later = seen.seen_after(np.array([0.5, 0.0, 0.0]))
    assert later.T_now_then == pytest.approx([-0.5, 0.0, 0.0])
    assert later.tracks[0].past[0][0] == pytest.approx([-1.5, 0.0, 0.0])


def test_the_papers_weight_is_the_product_of_both_densities() -> None:
    rng = np.random.default_rng(3)
    poses = np.column_stack([rng.uniform(0.0, 4.0, (300, 2)), rng.uniform(-3, 3, 300)])
    weights = rng.random(300)
    weights /= weights.sum()
    cells = [(1.05, 1.05), (3.05, 2.05), (3.15, 2.05)]
    weight = DensityWeight(as_printed=False, bandwidth_m=0.4)
    found = weight.reweighted([frame(*cells)], Particles(poses, weights))
    environment = np.array([density_at(p[:2], cells, [1.0] * 3, 0.4) for p in poses])
    assert found.weights == pytest.approx(weights * environment / (weights @ environment), abs=3e-4)

    weight = DensityWeight(as_printed=True, bandwidth_m=0.4)
    found = weight.reweighted([frame(*cells)], Particles(poses, weights))
    onboard = np.array([density_at(p[:2], poses[:, :2].tolist(), weights.tolist(), 0.4) for p in poses])
    assert found.weights == pytest.approx(onboard * environment / (onboard @ environment), abs=3e-4)


def test_frames_of_different_moments_make_one_density() -> None:
    poses = np.array([[2.05, 1.05, 0.0], [1.05, 1.05, 0.0], [3.05, 3.05, 0.0]])
    frames = [frame((1.05, 1.05), then=(-1.0, 0.0, 0.0)), frame((3.05, 3.05))]
    found = DensityWeight(as_printed=False, bandwidth_m=0.2).reweighted(frames, Particles.even(poses))
    assert found.weights == pytest.approx([0.5, 0.0, 0.5], abs=0.01)


def test_without_foreground_the_papers_weight_leaves_the_particles() -> None:
    particles = Particles.even(np.zeros((5, 3)))
    weight = DensityWeight(as_printed=False)
    assert weight.reweighted([frame()], particles) is particles
    assert weight.reweighted([frame((500.05, 0.05))], particles) is particles


def test_cells_with_little_surface_are_noise() -> None:
    points = np.array([[0.55, 0.55], [0.51, 0.59], [2.0, 2.0]])
    cells = moving_cells(
        FloorDetections(points, np.array([0.006, 0.006, 0.006]), np.ones(0, bool)), 0.1, 0.01
    )
    np.testing.assert_allclose(cells.centres, [[0.55, 0.55]])


def test_distances_and_memberships_of_cells_agree_with_all_pairs() -> None:
    rng = np.random.default_rng(5)
    cells = FloorCells(rng.integers(-20, 20, (30, 2)), 0.1).unique()
    positions = rng.uniform(-3.0, 3.0, (500, 2))
    centres = (np.floor(positions / 0.1) + 0.5) * 0.1
    distance = np.hypot(*(centres[:, None] - cells.centres).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(distance_to_cells(cells, positions, 0.8), np.minimum(distance, 0.8), atol=1e-5)
    assert np.array_equal(is_in_cells(cells, positions), distance < 0.05)


def test_a_beam_that_ends_at_a_detection_is_half_explained_and_other_beams_are_unchanged() -> None:
    occupied = np.zeros((100, 100), bool)
    occupied[:, 0] = True
    field = distance_field(occupied, GridGeometry(0.1, (0.0, 0.0)), 2.0)
    weigh = log_weight_of("likelihood-field", field, occupied, 60)
    beam = Beams(
        ranges=np.array([2.0]),
        bearings=np.zeros(1),
        returned=np.ones(1, bool),
        points=np.array([[2.0, 0.0]]),
        extrinsics=np.zeros(3),
        max_range_m=5.0,
        unreadable=0,
    )
    poses = np.array([[4.0, 5.0, 0.0], [4.0, 8.0, 0.0], [2.05, 5.0, np.pi]])
    person = np.array([[6.05, 5.05]])
    worst = FIELD_BEAM_WEIGHT * math.log(RANDOM_WEIGHT)
    alone = weigh(beam, poses, np.zeros((0, 2)))
    known = weigh(beam, poses, person)
    assert alone == pytest.approx([worst, worst, 0.0], abs=0.03)
    assert known[0] == pytest.approx(0.5 * worst, abs=0.02)
    assert known[1:] == pytest.approx(alone[1:])
