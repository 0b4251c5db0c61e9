"""The map of stereo-bayes: the scene of the paper's figures 8 and 9, averaging over the pose, and growth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.methods.stereo_bayes.adaptive_correlation import neighbour_correlation
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import StereoRays, range_edges

Floats = NDArray[np.float64]

FOCAL_BASELINE = 31.2
CERTAIN = np.diag([1e-8, 1e-8, 1e-8])
BEARINGS = np.linspace(-0.3, 0.3, 61)
START = np.zeros(3)


EDGES = range_edges(StereoBayesConfig(max_range_m=5.0))


def map_of(**settings: Any) -> BeliefMap:
    return BeliefMap(StereoBayesConfig.model_validate({"max_range_m": 5.0, **settings}))


def add_wall(
    belief: BeliefMap,
    x_m: float,
    covariance: Floats = CERTAIN,
    times: int = 1,
    pose: Floats = START,
) -> None:
    """Update by frames of a wall across the x axis, taken at a pose before it."""
    edges = np.cos(BEARINGS)[:, None] * EDGES[None]
    depths = (x_m - pose[0]) * np.cos(BEARINGS) / np.cos(BEARINGS + pose[2])
    disparities = FOCAL_BASELINE / depths
    rays = StereoRays(BEARINGS, disparities, edges, np.zeros(2), FOCAL_BASELINE)
    for _ in range(times):
        belief.update(pose, covariance, rays, belief.noise(64.0))


def probability_at(belief: BeliefMap, x: float, y: float = 0.0) -> float:
    layer = belief.layer()
    row, col = layer.geometry.cells(np.array([[x, y]]))[0]
    return float(layer.values[row, col])


def obstacle_at(belief: BeliefMap, x: float) -> float:
    """The largest probability of the cells around the surface of an obstacle at x."""
    return max(probability_at(belief, x + offset) for offset in (-0.05, 0.0, 0.05))


@pytest.mark.parametrize("likelihood", ["chain", "occlusion", "independent"])
def test_a_surface_is_occupied_and_the_space_before_it_is_free(likelihood: str) -> None:
    belief = map_of(likelihood=likelihood, prior=0.1)
    add_wall(belief, 1.02, times=6)
    assert probability_at(belief, 1.02) > 0.9
    assert probability_at(belief, 0.6) < 0.05


def test_false_matches_behind_an_obstacle_erase_it_only_with_the_conventional_likelihood() -> None:
    """Figures 8 and 9: in a room known to be free an obstacle is visible in six frames; then there are matches behind it."""
    changes: dict[str, list[float]] = {}
    for likelihood in ("chain", "independent"):
        belief = map_of(likelihood=likelihood, prior=0.3)
        add_wall(belief, 20.0, times=10)
        add_wall(belief, 1.02, times=6)
        before = obstacle_at(belief, 1.02)
        assert before > 0.9
        changes[likelihood] = []
        for _ in range(2):
            add_wall(belief, 3.5)
            changes[likelihood].append(obstacle_at(belief, 1.02) - before)
    assert abs(changes["chain"][0]) <= 0.02
    assert changes["chain"][1] > -0.05
    assert changes["independent"][1] < -0.5


def test_an_uncertain_yaw_blurs_distant_cells_more_than_near_ones() -> None:
    def width(depth_m: float) -> float:
        belief = map_of()
        edges = EDGES[None]
        lone = StereoRays(
            np.zeros(1), np.array([FOCAL_BASELINE / depth_m]), edges, np.zeros(2), FOCAL_BASELINE
        )
        covariance = np.diag([1e-8, 1e-8, np.radians(3.0) ** 2])
        belief.update(np.zeros(3), covariance, lone, belief.noise(64.0))
        near = [abs(probability_at(belief, 0.6 * depth_m, y) - 0.3) for y in np.arange(-0.5, 0.5, 0.02)]
        return float(np.sum(np.array(near) > 1e-3))

    assert width(4.0) > width(2.0)


def test_an_uncertain_position_makes_the_surface_less_certain() -> None:
    sharp, blurred = map_of(), map_of()
    add_wall(sharp, 2.02)
    add_wall(blurred, 2.02, np.diag([0.15**2, 0.15**2, 1e-8]))
    assert probability_at(sharp, 2.02) > probability_at(blurred, 2.02)
    assert probability_at(sharp, 1.0) == pytest.approx(probability_at(blurred, 1.0), abs=0.02)


def test_cells_behind_a_surface_are_unknown_in_the_map_and_expected_occupied_in_the_layer() -> None:
    belief = map_of()
    add_wall(belief, 2.02, times=6)
    occupancy = belief.occupancy()
    row, col = occupancy.geometry.cells(np.array([[2.6, 0.0]]))[0]
    assert not (col < occupancy.probability.shape[1]) or np.isnan(occupancy.probability[row, col])
    assert probability_at(belief, 2.1) > 0.5


def test_with_behind_once_many_views_of_a_surface_add_no_evidence_behind_it() -> None:
    """The chain with prior p expects a cell n cells behind a surface to be occupied with p + r^n (1 - p)."""
    behind = {}
    for mode in ("once", "each_frame"):
        rng = np.random.default_rng(0)
        belief = map_of(
            prior=0.2, correlation={"r0": 0.9}, advanced={"correlation": {"behind": mode, "behind_m": 0.1}}
        )
        for y in np.linspace(-1.5, 1.5, 61):
            add_wall(belief, 2.02 + rng.normal(0.0, 0.05), pose=np.array([0.0, y, -0.4 * y]))
        assert obstacle_at(belief, 2.02) > 0.9
        behind[mode] = probability_at(belief, 2.42)
    expected = 0.2 + 0.9**8 * 0.8
    assert 0.8 * expected < behind["once"] < expected < behind["each_frame"] - 0.1


def test_a_diverging_pose_ends_in_an_error_about_memory() -> None:
    belief = map_of(memory_limit_mb=50.0)
    add_wall(belief, 2.0)
    rays = StereoRays(np.zeros(1), np.array([10.0]), EDGES[None], np.zeros(2), FOCAL_BASELINE)
    with pytest.raises(MethodError, match="memory_limit_mb"):
        belief.update(np.array([1e6, 0.0, 0.0]), CERTAIN, rays, belief.noise(64.0))


def test_a_frame_without_rays_changes_nothing() -> None:
    belief = map_of()
    nothing = StereoRays(np.zeros(0), np.zeros(0), np.zeros((0, 5)), np.zeros(2), FOCAL_BASELINE)
    belief.update(np.zeros(3), CERTAIN, nothing, belief.noise(64.0))
    assert belief.occupancy().probability.size == 0


def test_the_correlation_of_a_map_is_that_of_its_runs() -> None:
    """A two-state Markov chain that remains occupied with 0.9 and free with 0.97 has the correlation 0.9 + 0.97 - 1."""
    rng = np.random.default_rng(0)
    states = np.zeros((400, 400), bool)
    for col in range(1, 400):
        remains = np.where(states[:, col - 1], 0.9, 0.97)
        states[:, col] = np.where(rng.random(400) < remains, states[:, col - 1], ~states[:, col - 1])
    along = neighbour_correlation(np.where(states, 0.99, 0.01))
    assert along is not None
    assert along == pytest.approx(0.5 * 0.87, abs=0.02)  # half of the pairs lie across independent rows


def test_the_adaptive_correlation_is_estimated_from_the_map() -> None:
    belief = map_of(correlation={"r0": 0.6}, advanced={"correlation": {"mode": "adaptive"}})
    add_wall(belief, 3.02, times=40)
    assert 0.75 < belief.correlation.r0 < 1.0  # free before the surface, occupied behind it: long runs
