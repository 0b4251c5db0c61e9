"""How strongly neighbouring cells of a map hang together (stereo-bayes paper, section 2.3, eqs. 7 and 8).

Along a ray cells form a two-state Markov chain with occupancy p and, at a distance of d cells, the correlation r0^d. The
same state then goes on by one step with the probability (eq. 7 for equal p)

    occupied: p + r (1 - p)        free: (1 - p) + r p        r = r0^(length of the step in cells)

A sample walks from a random cell in a random direction to the first change of occupancy; its steps before that are successes, the
change is a failure, and a sample that an unknown cell or the edge of the map cuts off has successes only (censored). r0 maximises
the likelihood of all steps.

The paper fits r0^n itself to the probability that the same state goes on over n cells. That takes the two states for one:
it is reported as `continuation`. Only the correlation fits into eq. 7, where p stands beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from gridslam.core.errors import MethodError
from gridslam.core.random import random_stream
from gridslam.kernels.occupancy_runs import UNKNOWN, follow_runs
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]

SAMPLES = 100_000
OCCUPIED_FROM = 0.5
REFERENCE_CELL_M = 0.05
LEAST_R0, MOST_R0 = 1e-6, 1.0 - 1e-9
STRAIGHT = ((0, 1), (1, 0), (0, -1), (-1, 0))
DIAGONAL = ((1, 1), (1, -1), (-1, -1), (-1, 1))


@dataclass(frozen=True, slots=True)
class RunCurve:
    """The probability that a state goes on for longer than a distance: Kaplan and Meier 1958, and by the fit.

    Arrays `(n,)`: distances in cells, and the two probabilities there.
    """

    distance_cells: Floats
    measured: Floats
    fitted: Floats


@dataclass(frozen=True, slots=True)
class CorrelationFit:
    """The correlation of neighbouring cells (eq. 8).

    `r0` is per cell of this map, with its standard error; `r0_at_5cm` is what it would be for cells of 5 cm;
    `continuation` is the probability per cell that the same state, whichever, goes on. `occupied_share` is p, `samples` counts
    the walks and `censored` those of them cut off.
    """

    r0: float
    standard_error: float
    r0_at_5cm: float
    continuation: float
    occupied_share: float
    resolution_m: float
    samples: int
    censored: int
    occupied: RunCurve
    free: RunCurve


@dataclass(frozen=True, slots=True)
class _Runs:
    """The walks: state they began in, steps before the change, whether it came, length of a step in cells; all `(n,)`."""

    occupied: NDArray[np.bool_]
    goes_on: NDArray[np.int64]
    changed: NDArray[np.bool_]
    step_cells: Floats


def fit_correlation(
    occupancy: OccupancyGrid,
    seed: int = 0,
    samples: int = SAMPLES,
    occupied_from: float = OCCUPIED_FROM,
    diagonals: bool = True,
) -> CorrelationFit:
    """r0 (eq. 8) of a known map by maximum likelihood. Cells with P > `occupied_from` are occupied.

    Raises MethodError: the map has no occupied or no free cells, or nothing but single known cells.
    """
    state = np.where(occupancy.probability > occupied_from, 1, 0).astype(np.int8)
    state[np.isnan(occupancy.probability)] = UNKNOWN
    known = np.argwhere(state != UNKNOWN)
    share = float((state == 1).sum() / max(len(known), 1))
    if not 0.0 < share < 1.0:
        raise MethodError(
            f"the map has no {'free' if share else 'occupied'} cells (P {'<=' if share else '>'} {occupied_from:g}): "
            "their correlation cannot be fitted"
        )
    runs = _sample(state, known, seed, samples, diagonals)
    if not runs.changed.any():
        raise MethodError("occupancy changes nowhere between known cells: their correlation cannot be fitted")
    r0 = _most_likely(runs, share)
    resolution_m = occupancy.geometry.resolution_m
    way = float((runs.step_cells * (runs.goes_on + runs.changed)).sum())
    return CorrelationFit(
        r0=r0,
        standard_error=_standard_error(runs, share, r0),
        r0_at_5cm=r0 ** (REFERENCE_CELL_M / resolution_m),
        continuation=float(max(1.0 - runs.changed.sum() / way, 0.0)),
        occupied_share=share,
        resolution_m=resolution_m,
        samples=samples,
        censored=int((~runs.changed).sum()),
        occupied=_curve(runs, runs.occupied, share + r0 * (1.0 - share)),
        free=_curve(runs, ~runs.occupied, 1.0 - share + r0 * share),
    )


def _sample(
    state: NDArray[np.int8], known: NDArray[np.int64], seed: int, samples: int, diagonals: bool
) -> _Runs:
    rng = random_stream(seed, "correlation")
    starts = known[rng.integers(len(known), size=samples)]
    directions = np.array(STRAIGHT + DIAGONAL if diagonals else STRAIGHT)
    steps = directions[rng.integers(len(directions), size=samples)]
    length, changed = follow_runs(state, starts, steps)
    return _Runs(
        state[starts[:, 0], starts[:, 1]] == 1, length - changed, changed, np.hypot(steps[:, 0], steps[:, 1])
    )


def _log_likelihood(r0: float, runs: _Runs, share: float) -> Floats:
    """Of every walk `(n,)`: its steps within the state, and the change if it came."""
    r = r0**runs.step_cells
    own = np.where(runs.occupied, share, 1.0 - share)
    stays = own + r * (1.0 - own)
    return np.asarray(runs.goes_on * np.log(stays) + runs.changed * np.log1p(-stays))


def _most_likely(runs: _Runs, share: float) -> float:
    """The r0 of the greatest likelihood, searched for in log(1 - r0) and so as exact near 1 as elsewhere."""

    def cost(x: float) -> float:
        return -float(_log_likelihood(-float(np.expm1(x)), runs, share).sum())

    bounds = (float(np.log(1.0 - MOST_R0)), float(np.log(1.0 - LEAST_R0)))
    found = optimize.minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return -float(np.expm1(found.x))


def _standard_error(runs: _Runs, share: float, r0: float) -> float:
    """The sandwich estimate (Huber 1967), which holds for steps of a walk that depend on each other."""
    h = 1e-3 * (1.0 - r0) * r0
    below, here, above = (_log_likelihood(r, runs, share) for r in (r0 - h, r0, r0 + h))
    score, bend = (above - below) / (2.0 * h), float((above - 2.0 * here + below).sum()) / h**2
    return float(np.sqrt((score**2).sum()) / abs(bend)) if bend else float("inf")


def _curve(runs: _Runs, chosen: NDArray[np.bool_], stays: float) -> RunCurve:
    """How long the chosen walks go on; a walk cut off counts up to where it was cut."""
    ends = (runs.step_cells * (runs.goes_on + runs.changed))[chosen]
    changed = runs.changed[chosen]
    distance, which = np.unique(ends, return_inverse=True)
    changes = np.bincount(which, weights=changed, minlength=len(distance))
    at_risk = len(ends) - np.searchsorted(np.sort(ends), distance)
    measured = np.cumprod(1.0 - changes / at_risk, dtype=np.float64)
    return RunCurve(distance, measured, stays**distance)
