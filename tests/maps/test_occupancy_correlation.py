"""The correlation of neighbouring cells, fitted to fields whose correlation is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.occupancy_correlation import fit_correlation

Bools = NDArray[np.bool_]


def chain(rng: np.random.Generator, length: int, occupied_run: float, free_run: float) -> Bools:
    """A two-state Markov chain with the given mean runs (cells): each run is geometric."""
    count = int(2.0 * length / (occupied_run + free_run)) + 100
    runs = np.stack(
        [rng.geometric(1.0 / free_run, count), rng.geometric(1.0 / occupied_run, count)], axis=1
    ).ravel()
    cells = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    assert len(cells) >= length
    return np.asarray(cells[:length])


def grid_of(cells: Bools, resolution_m: float = 0.05) -> OccupancyGrid:
    return OccupancyGrid(cells.astype(np.float32), GridGeometry(resolution_m, (0.0, 0.0)))


def crossed_chains(occupied_run: float, free_run: float, size: int = 2500) -> OccupancyGrid:
    """Occupied where a chain over rows and one over columns differ."""
    rng = np.random.default_rng(4)
    across, along = (chain(rng, size, occupied_run, free_run) for _ in range(2))
    return grid_of(across[:, None] ^ along[None, :])


@pytest.mark.parametrize(("occupied_run", "free_run"), [(45.0, 45.0), (4.0, 60.0), (20.0, 8.0)])
def test_r0_of_a_chain_follows_from_its_mean_runs(occupied_run: float, free_run: float) -> None:
    # A run of mean m persists with 1 - 1/m. By eq. 7 (equal p) P(E'|E) + P(not E'|not E) = 1 + r.
    row = chain(np.random.default_rng(1), 2_000_000, occupied_run, free_run)
    fit = fit_correlation(grid_of(row[None]), seed=0, diagonals=False)
    assert fit.r0 == pytest.approx(1.0 - 1.0 / occupied_run - 1.0 / free_run, abs=0.005)
    assert fit.occupied_ratio == pytest.approx(occupied_run / (occupied_run + free_run), abs=0.01)


def test_continuation_is_the_probability_that_either_state_persists() -> None:
    # From a random cell the expected distance to the change is p m1 + q m0, one change each.
    row = chain(np.random.default_rng(2), 2_000_000, 4.0, 60.0)
    fit = fit_correlation(grid_of(row[None]), seed=0, diagonals=False)
    distance = (4.0 * 4.0 + 60.0 * 60.0) / (4.0 + 60.0)
    assert fit.continuation == pytest.approx(1.0 - 1.0 / distance, abs=0.001)


def test_r0_of_crossed_chains_is_that_of_the_chain_along_an_axis() -> None:
    # Along a row the other chain is constant; with equal runs of 16 p is 1/2 and r = 1 - 2/16 either distance.
    fit = fit_correlation(crossed_chains(16.0, 16.0), seed=0, diagonals=False)
    assert fit.r0 == pytest.approx(1.0 - 2.0 / 16.0, abs=0.005)


def poisson_lines(count: int, size: int, seed: int) -> Bools:
    """Cells coloured by the parity of random lines below them; directions and distances are evenly distributed."""
    rng = np.random.default_rng(seed)
    radius = 0.75 * size
    angles = (np.arange(count) + rng.random(count)) * np.pi / count
    offsets = ((rng.permutation(count) + rng.random(count)) / count * 2.0 - 1.0) * radius
    x = np.arange(size) - 0.5 * size
    parity = np.zeros((size, size), bool)
    for angle, offset in zip(angles, offsets, strict=True):
        parity ^= x[:, None] * np.sin(angle) + x[None] * np.cos(angle) > offset
    return parity


def test_r0_of_random_lines_holds_along_axes_and_diagonals() -> None:
    # A line hits a segment of length d with the chance d / (pi R) and flips the parity: (1 - 2 d / (pi R))^n over n lines.
    size, count = 800, 160
    expected = (1.0 - 2.0 / (np.pi * 0.75 * size)) ** count
    fields = [grid_of(poisson_lines(count, size, seed)) for seed in range(4)]
    fitted = np.mean([fit_correlation(field, seed=0).r0 for field in fields])
    assert fitted == pytest.approx(expected, abs=0.005)


def test_unknown_cells_do_not_count_as_changes() -> None:
    row = chain(np.random.default_rng(1), 2_000_000, 45.0, 45.0).astype(np.float32)
    whole = fit_correlation(OccupancyGrid(row[None], GridGeometry(0.05, (0.0, 0.0))), diagonals=False)
    row[::40] = np.nan
    cut = fit_correlation(OccupancyGrid(row[None], GridGeometry(0.05, (0.0, 0.0))), diagonals=False)
    assert cut.censored > 1.5 * whole.censored
    assert cut.r0 == pytest.approx(whole.r0, abs=0.005)


def test_the_measured_curve_is_the_fraction_of_longer_runs() -> None:
    row = chain(np.random.default_rng(5), 500_000, 10.0, 10.0)
    fit = fit_correlation(grid_of(row[None]), diagonals=False)
    for curve in (fit.occupied, fit.free):
        short = curve.distance_cells <= 20.0
        np.testing.assert_allclose(curve.measured[short], 0.9 ** curve.distance_cells[short], atol=0.02)
        np.testing.assert_allclose(curve.fitted[short], 0.9 ** curve.distance_cells[short], atol=0.02)


def test_the_standard_error_is_the_standard_deviation_over_seeds() -> None:
    grid = crossed_chains(16.0, 16.0, size=1500)
    fits = [fit_correlation(grid, seed, samples=1000, diagonals=False) for seed in range(40)]
    std = np.std([fit.r0 for fit in fits])
    assert fits[0].standard_error == pytest.approx(std, rel=0.4)


def test_r0_at_5_cm_follows_from_the_size_of_the_cells() -> None:
    coarse = fit_correlation(grid_of(crossed_chains(16.0, 16.0).probability > 0.5, resolution_m=0.1))
    assert coarse.r0_at_5cm == pytest.approx(np.sqrt(coarse.r0))


def test_the_same_seed_gives_the_same_fit() -> None:
    grid = crossed_chains(16.0, 16.0, size=300)
    assert fit_correlation(grid, seed=3, samples=1000).r0 == fit_correlation(grid, seed=3, samples=1000).r0
    assert fit_correlation(grid, seed=3, samples=1000).r0 != fit_correlation(grid, seed=4, samples=1000).r0


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (np.zeros((5, 5), np.float32), "no occupied cells"),
        (np.ones((5, 5), np.float32), "no free cells"),
        (np.full((5, 5), np.nan, np.float32), "no occupied cells"),
        (np.array([[0.0, np.nan, 1.0]], np.float32), "changes nowhere"),
    ],
)
def test_a_map_without_changes_is_refused(cells: NDArray[np.float32], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        fit_correlation(OccupancyGrid(cells, GridGeometry(0.05, (0.0, 0.0))))


@pytest.mark.real_data
@pytest.mark.filterwarnings("ignore")
def test_a_public_map_has_a_correlation_between_neighbours(data_dir: Path) -> None:
    fit = fit_correlation(load_any_map(data_dir / "maps" / "turtlebot3_world.yaml"))
    assert 0.5 < fit.r0 < 0.95
    assert fit.standard_error < 0.01
