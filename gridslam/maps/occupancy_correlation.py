"""The correlation of neighbouring cells of a map (stereo-bayes paper, section 2.3, eqs. 7 and 8).

Along a ray cells form a two-state Markov chain with occupancy p and, at a distance of d cells, the correlation r0^d. The
state then persists over one step with the probability (eq. 7 for equal p)

    occupied: p + r (1 - p)        free: (1 - p) + r p        r = r0^(length of the step in cells)

A sample walks from a random cell in a random direction to the first change of occupancy. Its steps before the change are
successes and the change is a failure; a walk that ends at an unknown cell or at the edge of the map is censored and has successes
only. r0 maximises the likelihood of all steps.

The paper fits r0^n itself to the probability that the state persists over n cells, which merges the two states; this is reported
as `continuation`. Only the correlation agrees with eq. 7, which has p beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from gridslam.core.errors import MethodError
from gridslam.core.random import random_stream
from gridslam.kernels.grids.occupancy_runs import UNKNOWN, follow_runs
from gridslam.maps.occupancy import OccupancyGrid, nth_cells

Floats = NDArray[np.float64]

SAMPLES = 100_000
OCCUPIED_FROM = 0.5
REFERENCE_CELL_M = 0.05
MIN_R0, MAX_R0 = 1e-6, 1.0 - 1e-9
R0_TOLERANCE = 1e-7  # tolerance of log(1 - r0)
DIFFERENCE_STEP = 1e-3  # step of the numerical derivatives, relative to r0 (1 - r0)
STRAIGHT = ((0, 1), (1, 0), (0, -1), (-1, 0))
DIAGONAL = ((1, 1), (1, -1), (-1, -1), (-1, 1))


@dataclass(frozen=True, slots=True)
class RunCurve:
    """The probability that a run of equal occupancy is longer than a distance: measured (Kaplan and Meier 1958) and fitted.

    Arrays `(n,)`: distances in cells, and the two probabilities there.
    """

    distance_cells: Floats
    measured: Floats
    fitted: Floats


@dataclass(frozen=True, slots=True)
class CorrelationFit:
    """The correlation of neighbouring cells (eq. 8).

    `r0` is per cell of this map, with its standard error; `r0_at_5cm` is the same for cells of 5 cm; `continuation` is the
    probability per cell that either state persists. `occupied_ratio` is p; `samples` is the number of walks, `censored` that of
    the censored ones.
    """

    r0: float
    standard_error: float
    r0_at_5cm: float
    continuation: float
    occupied_ratio: float
    resolution_m: float
    samples: int
    censored: int
    occupied: RunCurve
    free: RunCurve


@dataclass(frozen=True, slots=True)
class _Runs:
    """The walks: initial state, number of steps before the change, whether it was met, step length in cells; all `(n,)`."""

    occupied: NDArray[np.bool_]
    steps: NDArray[np.int64]
    changed: NDArray[np.bool_]
    step_cells: Floats


def fit_correlation(
    occupancy: OccupancyGrid,
    seed: int = 0,
    samples: int = SAMPLES,
    occupied_from: float = OCCUPIED_FROM,
    diagonals: bool = True,
) -> CorrelationFit:
    """r0 (eq. 8) of a known map by maximum likelihood, from `samples` walks. Cells with P > `occupied_from` are occupied.

    Raises MethodError: the map has no occupied or no free cells, or nothing but single known cells.
    """
    state = (occupancy.probability > occupied_from).view(np.int8)
    np.copyto(state, UNKNOWN, where=np.isnan(occupancy.probability))
    known = state != UNKNOWN
    ratio = float(np.count_nonzero(state == 1) / max(int(np.count_nonzero(known)), 1))
    if not 0.0 < ratio < 1.0:
        raise MethodError(
            f"the map has no {'free' if ratio else 'occupied'} cells (P {'<=' if ratio else '>'} {occupied_from:g}): "
            "their correlation cannot be fitted"
        )
    runs = _sample(state, known, seed, samples, diagonals)
    if not runs.changed.any():
        raise MethodError("occupancy changes nowhere between known cells: their correlation cannot be fitted")
    r0 = _likeliest(runs, ratio)
    resolution_m = occupancy.geometry.resolution_m
    travelled = float((runs.step_cells * (runs.steps + runs.changed)).sum())
    return CorrelationFit(
        r0=r0,
        standard_error=_standard_error(runs, ratio, r0),
        r0_at_5cm=r0 ** (REFERENCE_CELL_M / resolution_m),
        continuation=float(max(1.0 - runs.changed.sum() / travelled, 0.0)),
        occupied_ratio=ratio,
        resolution_m=resolution_m,
        samples=samples,
        censored=int((~runs.changed).sum()),
        occupied=_curve(runs, runs.occupied, ratio + r0 * (1.0 - ratio)),
        free=_curve(runs, ~runs.occupied, 1.0 - ratio + r0 * ratio),
    )


def _sample(
    state: NDArray[np.int8], known: NDArray[np.bool_], seed: int, samples: int, diagonals: bool
) -> _Runs:
    rng = random_stream(seed, "correlation")
    starts = nth_cells(known, rng.integers(int(np.count_nonzero(known)), size=samples))
    directions = np.array(STRAIGHT + DIAGONAL if diagonals else STRAIGHT)
    steps = directions[rng.integers(len(directions), size=samples)]
    length, changed = follow_runs(state, starts, steps)
    return _Runs(
        state[starts[:, 0], starts[:, 1]] == 1, length - changed, changed, np.hypot(steps[:, 0], steps[:, 1])
    )


def _log_likelihood(r0: float, runs: _Runs, ratio: float) -> Floats:
    """Log-likelihood of every walk `(n,)`: of its steps within the state, and of the change if it was met."""
    r = r0**runs.step_cells
    own = np.where(runs.occupied, ratio, 1.0 - ratio)
    persists = own + r * (1.0 - own)
    return np.asarray(runs.steps * np.log(persists) + runs.changed * np.log1p(-persists))


def _likeliest(runs: _Runs, ratio: float) -> float:
    """The r0 with the largest likelihood; the search is in log(1 - r0), so that it is equally accurate near 1."""

    def cost(x: float) -> float:
        return -float(_log_likelihood(-float(np.expm1(x)), runs, ratio).sum())

    bounds = (float(np.log(1.0 - MAX_R0)), float(np.log(1.0 - MIN_R0)))
    found = optimize.minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": R0_TOLERANCE})
    return -float(np.expm1(found.x))


def _standard_error(runs: _Runs, ratio: float, r0: float) -> float:
    """The sandwich estimate (Huber 1967), which is valid for dependent steps of a walk."""
    h = DIFFERENCE_STEP * (1.0 - r0) * r0
    below, here, above = (_log_likelihood(r, runs, ratio) for r in (r0 - h, r0, r0 + h))
    score, curvature = (above - below) / (2.0 * h), float((above - 2.0 * here + below).sum()) / h**2
    return float(np.sqrt((score**2).sum()) / abs(curvature)) if curvature else float("inf")


def _curve(runs: _Runs, chosen: NDArray[np.bool_], persists: float) -> RunCurve:
    """Lengths of the chosen walks; a censored walk counts up to its end."""
    lengths = (runs.step_cells * (runs.steps + runs.changed))[chosen]
    changed = runs.changed[chosen]
    distance, which = np.unique(lengths, return_inverse=True)
    changes = np.bincount(which, weights=changed, minlength=len(distance))
    at_risk = len(lengths) - np.searchsorted(np.sort(lengths), distance)
    measured = np.cumprod(1.0 - changes / at_risk, dtype=np.float64)
    return RunCurve(distance, measured, persists**distance)
