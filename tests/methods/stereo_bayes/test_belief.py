"""The map of stereo-bayes: the scene of the paper's figures 8 and 9, blur, and growth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import Rays, range_edges
from gridslam.methods.stereo_bayes.running_correlation import neighbour_correlation

Floats = NDArray[np.float64]

FOCAL_BASELINE = 31.2
SURE = np.diag([1e-8, 1e-8, 1e-8])
BEARINGS = np.linspace(-0.3, 0.3, 61)
STARTS = np.zeros(3)


EDGES = range_edges(StereoBayesConfig(max_range_m=5.0))


def map_of(**settings: Any) -> BeliefMap:
    return BeliefMap(StereoBayesConfig.model_validate({"max_range_m": 5.0, **settings}))


def see(
    belief: BeliefMap,
    x_m: float,
    covariance: Floats = SURE,
    times: int = 1,
    place: Floats = STARTS,
) -> None:
    """Frames of a wall across the x axis, from a place before it."""
    edges = np.cos(BEARINGS)[:, None] * EDGES[None]
    depths = (x_m - place[0]) * np.cos(BEARINGS) / np.cos(BEARINGS + place[2])
    disparities = FOCAL_BASELINE / depths
    rays = Rays(BEARINGS, disparities, edges, np.zeros(2), FOCAL_BASELINE)
    for _ in range(times):
        belief.update(place, covariance, rays, belief.noise(64.0))


def probability_at(belief: BeliefMap, x: float, y: float = 0.0) -> float:
    layer = belief.layer()
    row, col = layer.geometry.cells(np.array([[x, y]]))[0]
    return float(layer.values[row, col])


def obstacle_at(belief: BeliefMap, x: float) -> float:
    """The surest cell of an obstacle whose surface is at x."""
    return max(probability_at(belief, x + off) for off in (-0.05, 0.0, 0.05))


@pytest.mark.parametrize("likelihood", ["chain", "occlusion", "independent"])
def test_a_surface_is_found_and_the_way_to_it_is_free(likelihood: str) -> None:
    belief = map_of(likelihood=likelihood, prior=0.1)
    see(belief, 1.02, times=6)
    assert probability_at(belief, 1.02) > 0.9
    assert probability_at(belief, 0.6) < 0.05


def test_false_matches_behind_wipe_out_an_obstacle_only_with_the_conventional_likelihood() -> None:
    """Figures 8 and 9: in a room known to be free an obstacle is seen for six frames, then something is matched behind it."""
    changes: dict[str, list[float]] = {}
    for likelihood in ("chain", "independent"):
        belief = map_of(likelihood=likelihood, prior=0.3)
        see(belief, 20.0, times=10)
        see(belief, 1.02, times=6)
        before = obstacle_at(belief, 1.02)
        assert before > 0.9
        changes[likelihood] = []
        for _ in range(2):
            see(belief, 3.5)
            changes[likelihood].append(obstacle_at(belief, 1.02) - before)
    assert abs(changes["chain"][0]) <= 0.02
    assert changes["chain"][1] > -0.05
    assert changes["independent"][1] < -0.5


def test_an_uncertain_heading_blurs_what_is_far_more_than_what_is_near() -> None:
    def width(depth_m: float) -> float:
        belief = map_of()
        edges = EDGES[None]
        lone = Rays(np.zeros(1), np.array([FOCAL_BASELINE / depth_m]), edges, np.zeros(2), FOCAL_BASELINE)
        covariance = np.diag([1e-8, 1e-8, np.radians(3.0) ** 2])
        belief.update(np.zeros(3), covariance, lone, belief.noise(64.0))
        near = [abs(probability_at(belief, 0.6 * depth_m, y) - 0.3) for y in np.arange(-0.5, 0.5, 0.02)]
        return float(np.sum(np.array(near) > 1e-3))

    assert width(4.0) > width(2.0)


def test_an_uncertain_place_says_less_about_the_surface() -> None:
    sharp, blurred = map_of(), map_of()
    see(sharp, 2.02)
    see(blurred, 2.02, np.diag([0.15**2, 0.15**2, 1e-8]))
    assert probability_at(sharp, 2.02) > probability_at(blurred, 2.02)
    assert probability_at(sharp, 1.0) == pytest.approx(probability_at(blurred, 1.0), abs=0.02)


def test_what_no_ray_came_to_is_unknown_in_the_map_though_the_chain_expects_more_of_the_obstacle() -> None:
    belief = map_of()
    see(belief, 2.02, times=6)
    occupancy = belief.occupancy()
    row, col = occupancy.geometry.cells(np.array([[2.6, 0.0]]))[0]
    assert not (col < occupancy.probability.shape[1]) or np.isnan(occupancy.probability[row, col])
    assert probability_at(belief, 2.1) > 0.5


def test_seeing_a_surface_from_many_sides_makes_what_is_behind_it_no_surer() -> None:
    """The chain with prior p expects an obstacle to go on for n cells with p + r^n (1 - p)."""
    behind = {}
    for mode in ("once", "each_frame"):
        rng = np.random.default_rng(0)
        belief = map_of(prior=0.2, correlation={"r0": 0.9, "behind": mode, "behind_m": 0.1})
        for y in np.linspace(-1.5, 1.5, 61):
            see(belief, 2.02 + rng.normal(0.0, 0.05), place=np.array([0.0, y, -0.4 * y]))
        assert obstacle_at(belief, 2.02) > 0.9
        behind[mode] = probability_at(belief, 2.42)
    expected = 0.2 + 0.9**8 * 0.8
    assert 0.8 * expected < behind["once"] < expected < behind["each_frame"] - 0.1


def test_a_pose_that_has_gone_astray_does_not_eat_the_machine() -> None:
    belief = map_of(memory_limit_mb=50.0)
    see(belief, 2.0)
    rays = Rays(np.zeros(1), np.array([10.0]), EDGES[None], np.zeros(2), FOCAL_BASELINE)
    with pytest.raises(MethodError, match="memory_limit_mb"):
        belief.update(np.array([1e6, 0.0, 0.0]), SURE, rays, belief.noise(64.0))


def test_rays_that_tell_nothing_change_nothing() -> None:
    belief = map_of()
    nothing = Rays(np.zeros(0), np.zeros(0), np.zeros((0, 5)), np.zeros(2), FOCAL_BASELINE)
    belief.update(np.zeros(3), SURE, nothing, belief.noise(64.0))
    assert belief.occupancy().probability.size == 0


def test_the_correlation_of_a_map_is_that_of_its_runs() -> None:
    """A two-state Markov chain that stays occupied with 0.9 and free with 0.97 has the correlation 0.9 + 0.97 - 1."""
    rng = np.random.default_rng(0)
    states = np.zeros((400, 400), bool)
    for col in range(1, 400):
        stays = np.where(states[:, col - 1], 0.9, 0.97)
        states[:, col] = np.where(rng.random(400) < stays, states[:, col - 1], ~states[:, col - 1])
    along = neighbour_correlation(np.where(states, 0.99, 0.01))
    assert along is not None
    across_is_none = 0.0  # rows are independent, and as many pairs lie across as along
    assert along == pytest.approx(0.5 * (0.87 + across_is_none), abs=0.02)


def test_with_the_adaptive_correlation_the_map_sets_it() -> None:
    belief = map_of(correlation={"mode": "adaptive", "r0": 0.6})
    see(belief, 3.02, times=40)
    assert 0.75 < belief.correlation.r0 < 1.0  # free before the surface, occupied behind it: long runs
