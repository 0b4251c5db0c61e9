"""The kernels of stereo-bayes beside their reference implementations, on a frame of 60 rays with 60 cells each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.kernels.grids.occupancy_runs import UNKNOWN, follow_runs
from gridslam.kernels.stereo import chain, polar_window, stereo_update
from gridslam.kernels.stereo.stereo_columns import BinCriteria, HeightBand, measure_columns
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.kernel_pairs import Pair, rows_of_pairs
from tests.reference import chain as chain_reference
from tests.reference import polar_window as window_reference
from tests.reference import stereo_columns as columns_reference
from tests.reference import stereo_update as update_reference
from tests.reference.occupancy_runs import follow_run

ALONE = True

RAYS, CELLS = 60, 60
BEARINGS = np.linspace(-0.6, 0.6, RAYS)


def rows() -> Iterator[BenchmarkRow]:
    """From a disparity image to the cells, and the runs for the fit of the correlation."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("measure_columns", 6.0, columns(rng)),
            ("priors_of_rays", 10.0, priors(rng)),
            ("likelihoods_of_rays", 150.0, likelihoods(rng)),
            ("expected_behind", 25.0, expectations(rng)),
            ("couple_neighbouring_rays", 1.0, messages(rng)),
            ("averaged_over_yaw", 7.0, yaw_offsets(rng)),
            ("window_of_rays", 40.0, window(rng)),
            ("apply_update", 0.4, cells(rng)),
            ("follow_runs", 60.0, runs(rng)),
        )
    )


def columns(rng: np.random.Generator) -> Pair:
    """A disparity image of 320 x 240 pixels in bins of five columns, against numpy."""
    disparity = rng.normal(12.0, 1.5, (240, 320)).astype(np.float32)
    disparity[rng.random(disparity.shape) < 0.3] = np.nan
    slope = np.repeat(np.linspace(0.3, -0.3, 240, dtype=np.float32)[:, None], 320, axis=1)
    extent = np.maximum(0.8 * np.arange(129), 10.0)
    band = HeightBand(slope, focal_baseline=30.0, camera_m=0.6, low_m=0.1, high_m=1.5)
    criteria = BinCriteria(5, 64.0, extent, min_matched_ratio=0.3, take_nearest=False)
    image = (disparity, band, criteria)
    return lambda: measure_columns(*image), lambda: columns_reference.measure_columns(*image)


def priors(rng: np.random.Generator) -> Pair:
    """The cells of a map along the rays."""
    log_odds = rng.normal(size=(150, 150))
    rays = polar_window.GridRays(np.array([75.3, 74.6]), BEARINGS, first=1.5, cells=CELLS)
    return (
        lambda: polar_window.priors_of_rays(log_odds, rays, -0.5, 0.8),
        lambda: [window_reference.priors_of_ray(log_odds, rays, i, -0.5, 0.8) for i in range(RAYS)],
    )


def likelihoods(rng: np.random.Generator) -> Pair:
    """The exact chain, against the sum over the first occupied cell."""
    prior, correlation = rng.uniform(0.01, 0.9, (RAYS, CELLS)), rng.uniform(0.0, 1.0, (RAYS, CELLS))
    first, none = rng.uniform(0.0, 3.0, (RAYS, CELLS)), rng.uniform(0.0, 1.0, RAYS)
    rays = [
        (a, b, c, d)
        for a, b, c, d in zip(
            prior.tolist(), correlation.tolist(), first.tolist(), none.tolist(), strict=True
        )
    ]
    return (
        lambda: chain.likelihoods_of_rays(chain.CellPriors(prior, correlation), first, none, False),
        lambda: [chain_reference.likelihoods(*ray) for ray in rays],
    )


def expectations(rng: np.random.Generator) -> Pair:
    """The expectation of the chain behind the first obstacle."""
    first, correlation = rng.dirichlet(np.ones(CELLS + 1), RAYS), rng.uniform(0.5, 1.0, (RAYS, CELLS))
    reached = np.cumsum(first[:, ::-1], axis=1)[:, :0:-1].copy()
    rays = list(zip(first[:, :-1].tolist(), correlation.tolist(), strict=True))
    return (
        lambda: chain.expected_behind(reached, correlation, 0.25),
        lambda: [chain_reference.expected_behind(*ray, 0.25) for ray in rays],
    )


def messages(rng: np.random.Generator) -> Pair:
    """Messages between neighbouring rays, against numpy."""
    evidence = chain.RayEvidence(*rng.uniform(0.2, 3.0, (2, RAYS, CELLS)), reached=rng.random((RAYS, CELLS)))
    frame = (evidence, BEARINGS, np.arange(2.0, 2.0 + CELLS), 0.8, 0.5)
    return (
        lambda: stereo_update.couple_neighbouring_rays(*frame),
        lambda: update_reference.couple_neighbouring_rays(*frame),
    )


def yaw_offsets(rng: np.random.Generator) -> Pair:
    """Five values of all rays, averaged over seven yaw offsets."""
    rays = polar_window.PolarWindow(rng.normal(size=(5, RAYS, CELLS)), rng.random(5), BEARINGS, 0.02)
    frame = (rays, np.linspace(-0.1, 0.1, 7), np.full(7, 1 / 7))
    angles = np.linspace(-0.7, 0.7, 80)
    return (
        lambda: polar_window.averaged_over_yaw(*frame, angles),
        lambda: window_reference.averaged_over_yaw(*frame, angles),
    )


def window(rng: np.random.Generator) -> Pair:
    """Five values of all rays into the cells before the robot."""
    rays = polar_window.PolarWindow(rng.normal(size=(5, RAYS, CELLS)), rng.random(5), BEARINGS, 0.02)
    cells = (2.0, np.array([0.3, -40.2]), 80, 65)
    return (
        lambda: polar_window.window_of_rays(rays, *cells),
        lambda: window_reference.window_of_rays(rays, *cells),
    )


def cells(rng: np.random.Generator) -> Pair:
    """The update of 80 x 65 cells, against numpy."""
    log_odds, reached = rng.normal(0.0, 3.0, (80, 65)), rng.random((80, 65))
    evidence = stereo_update.CellEvidence(*rng.uniform(0.1, 5.0, (2, 80, 65)), *rng.random((3, 80, 65)))
    rule = stereo_update.UpdateRule(
        0.4, prior_log_odds=-1.2, max_log_odds=4.0, min_probability=1e-3, behind_once=True
    )
    changed = log_odds.copy(), reached.copy()
    return (
        lambda: stereo_update.apply_update(*changed, evidence, rule),
        lambda: update_reference.updated(log_odds, reached, evidence, rule),
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
