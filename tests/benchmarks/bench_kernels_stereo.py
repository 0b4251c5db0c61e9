"""The kernels of stereo-bayes beside their slow reference implementations, on a frame of 60 rays with 60 cells each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.kernels import chain, polar_window, stereo_update
from gridslam.kernels.occupancy_runs import UNKNOWN, follow_runs
from gridslam.kernels.stereo_columns import measure_columns
from tests.benchmarks.harness import Row
from tests.benchmarks.kernel_pairs import Pair, rows_of_pairs
from tests.reference import chain as chain_reference
from tests.reference import polar_window as window_reference
from tests.reference import stereo_columns as columns_reference
from tests.reference import stereo_update as update_reference
from tests.reference.occupancy_runs import follow_run

ALONE = True

RAYS, CELLS = 60, 60
BEARINGS = np.linspace(-0.6, 0.6, RAYS)


def rows() -> Iterator[Row]:
    """From a disparity image to the cells, and the runs from which the correlation of cells is learnt."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("measure_columns", 6.0, columns(rng)),
            ("priors_of_rays", 10.0, priors(rng)),
            ("likelihoods_of_rays", 250.0, likelihoods(rng)),
            ("expected_behind", 50.0, expectations(rng)),
            ("told_across", 1.0, messages(rng)),
            ("averaged_over_turns", 15.0, turns(rng)),
            ("window_of_rays", 40.0, window(rng)),
            ("tell_cells", 0.4, cells(rng)),
            ("follow_runs", 60.0, runs(rng)),
        )
    )


def columns(rng: np.random.Generator) -> Pair:
    """A disparity image of 320 x 240 pixels in bins of five columns, against numpy."""
    disparity = rng.normal(12.0, 1.5, (240, 320)).astype(np.float32)
    disparity[rng.random(disparity.shape) < 0.3] = np.nan
    slope = np.repeat(np.linspace(0.3, -0.3, 240, dtype=np.float32)[:, None], 320, axis=1)
    image = (disparity, slope, 30.0, 0.6, 0.1, 1.5, 5, 64.0, np.maximum(0.8 * np.arange(129), 10.0), 0.3)
    return lambda: measure_columns(*image, False), lambda: columns_reference.measure_columns(*image)


def priors(rng: np.random.Generator) -> Pair:
    """The cells of a map that the rays meet."""
    log_odds, eye = rng.normal(size=(150, 150)), np.array([75.3, 74.6])
    along = (1.5, CELLS, -0.5, 0.8)
    return (
        lambda: polar_window.priors_of_rays(log_odds, eye, BEARINGS, *along),
        lambda: [window_reference.priors_of_ray(log_odds, eye, float(b), *along) for b in BEARINGS],
    )


def likelihoods(rng: np.random.Generator) -> Pair:
    """The exact chain, against the sum over the cells that may be the first occupied one."""
    prior, correlation = rng.uniform(0.01, 0.9, (RAYS, CELLS)), rng.uniform(0.0, 1.0, (RAYS, CELLS))
    first, none = rng.uniform(0.0, 3.0, (RAYS, CELLS)), rng.uniform(0.0, 1.0, RAYS)
    rays = [
        (a, b, c, d)
        for a, b, c, d in zip(
            prior.tolist(), correlation.tolist(), first.tolist(), none.tolist(), strict=True
        )
    ]
    return (
        lambda: chain.likelihoods_of_rays(prior, correlation, first, none, False),
        lambda: [chain_reference.likelihoods(*ray) for ray in rays],
    )


def expectations(rng: np.random.Generator) -> Pair:
    """What the chain expects behind the first obstacle."""
    first, correlation = rng.dirichlet(np.ones(CELLS + 1), RAYS), rng.uniform(0.5, 1.0, (RAYS, CELLS))
    reached = np.cumsum(first[:, ::-1], axis=1)[:, :0:-1].copy()
    rays = list(zip(first[:, :-1].tolist(), correlation.tolist(), strict=True))
    return (
        lambda: chain.expected_behind(reached, correlation, 0.25),
        lambda: [chain_reference.expected_behind(*ray, 0.25) for ray in rays],
    )


def messages(rng: np.random.Generator) -> Pair:
    """Messages between neighbouring rays, against numpy."""
    frame = (*rng.uniform(0.2, 3.0, (2, RAYS, CELLS)), BEARINGS, np.arange(2.0, 2.0 + CELLS), 0.8, 0.5)
    return lambda: stereo_update.told_across(*frame), lambda: update_reference.told_across(*frame)


def turns(rng: np.random.Generator) -> Pair:
    """Five values of all rays, the mean over seven headings."""
    headings = np.linspace(-0.1, 0.1, 7)
    frame = (rng.normal(size=(5, RAYS, CELLS)), rng.random(5), BEARINGS, 0.02, headings, np.full(7, 1 / 7))
    angles = np.linspace(-0.7, 0.7, 80)
    return (
        lambda: polar_window.averaged_over_turns(*frame, angles),
        lambda: window_reference.averaged_over_turns(*frame, angles),
    )


def window(rng: np.random.Generator) -> Pair:
    """Five values of all rays into the cells before the robot."""
    rays = (rng.normal(size=(5, RAYS, CELLS)), rng.random(5), BEARINGS, 0.02, 2.0)
    cells = (np.array([0.3, -40.2]), 80, 65)
    return (
        lambda: polar_window.window_of_rays(*rays, *cells),
        lambda: window_reference.window_of_rays(*rays, *cells),
    )


def cells(rng: np.random.Generator) -> Pair:
    """The update of 80 x 65 cells, against numpy."""
    values = np.stack([rng.normal(0.0, 3.0, (80, 65)), rng.random((80, 65))], axis=-1)
    told = np.concatenate([rng.uniform(0.1, 5.0, (2, 80, 65)), rng.random((3, 80, 65))])
    frame = (told, 0.4, -1.2, 4.0, 1e-3, True)
    changed = values.copy()
    return (
        lambda: stereo_update.tell_cells(changed, *frame),
        lambda: update_reference.told_cells(values, *frame),
    )


def runs(rng: np.random.Generator) -> Pair:
    """5000 walks over a map until its state changes."""
    state = rng.choice([0, 1, UNKNOWN], (200, 200), p=[0.93, 0.06, 0.01]).astype(np.int8)
    known = np.argwhere(state != UNKNOWN)
    starts = known[rng.integers(len(known), size=5000)]
    steps = np.array([(0, 1), (1, 0), (-1, -1), (1, -1)])[rng.integers(4, size=5000)]
    walks = [((a, b), (c, d)) for (a, b), (c, d) in zip(starts.tolist(), steps.tolist(), strict=True)]
    return (
        lambda: follow_runs(state, starts, steps),
        lambda: [follow_run(state, *walk, UNKNOWN) for walk in walks],
    )
