"""Statistics over the seeds of each log, config and override: means, deviations and success rates with 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gridslam.sweep.job_result import RunRow

NUMBERS = ("mean", "mean_low", "mean_high", "sd", "min", "median", "max")
RATES = ("rate", "rate_low", "rate_high")
STATISTICS = (*NUMBERS, *RATES, "n", "missing")
CONFIDENCE = 0.95
Z = 1.959963984540054  # quantile of the normal distribution for CONFIDENCE


@dataclass(frozen=True, slots=True)
class Measure:
    """Statistics of one measure over the seeds: `n` runs have a value, `missing` finished runs have none."""

    n: int
    missing: int
    values: Mapping[str, float]

    def statistic(self, name: str) -> float | None:
        """The statistic with a name of STATISTICS; None if it is not defined for this measure (such as the rate of a length)."""
        return {**self.values, "n": self.n, "missing": self.missing}.get(name)


@dataclass(frozen=True, slots=True)
class Group:
    """All seeds of one log, config and override."""

    log: str
    config: str
    override: str
    runs: int
    done: int
    measures: Mapping[str, Measure]


def summarize(rows: Sequence[RunRow], successes: Sequence[str] = ()) -> list[Group]:
    """The groups in the order of the rows. A failed run counts as a failure in all `successes` (keys `success.*`)."""
    grouped: dict[tuple[str, str, str], list[RunRow]] = {}
    for row in rows:
        grouped.setdefault((row.log, row.config, row.override), []).append(row)
    return [_group(*name, members, successes) for name, members in grouped.items()]


def _group(log: str, config: str, override: str, rows: Sequence[RunRow], successes: Sequence[str]) -> Group:
    done = [row for row in rows if row.is_done]
    tried = [row for row in rows if row.result.state != "not run"]
    measures = {"run.done": _rate([row.is_done for row in tried], 0)} if tried else {}
    for key in successes:
        if tried:
            measures[key] = _rate([row.is_done and row.measures[key] is True for row in tried], 0)
    for key in dict.fromkeys(key for row in done for key in row.measures if key not in successes):
        measure = _measure([row.measures.get(key) for row in done])
        if measure is not None:
            measures[key] = measure
    return Group(log, config, override=override, runs=len(rows), done=len(done), measures=measures)


def _measure(found: Sequence[object]) -> Measure | None:
    """Statistics of numbers or Booleans; None if any value is text. An absent value, null or NaN counts as missing."""
    values = [
        float(value) for value in found if isinstance(value, (bool, int, float)) and math.isfinite(value)
    ]
    if any(isinstance(value, str) for value in found):
        return None
    if any(isinstance(value, bool) for value in found):
        return _rate([value == 1.0 for value in values], len(found) - len(values))
    return Measure(len(values), len(found) - len(values), number_statistics(values))


def _rate(hits: Sequence[bool], missing: int) -> Measure:
    low, high = wilson_interval(sum(hits), len(hits))
    rate = sum(hits) / len(hits) if hits else math.nan
    return Measure(len(hits), missing, dict(zip(RATES, (rate, low, high), strict=True)))


def number_statistics(values: Sequence[float]) -> dict[str, float]:
    """Mean with Student's interval, sample standard deviation, min, median, max; NaN with too few values."""
    if not values:
        return dict.fromkeys(NUMBERS, math.nan)
    array = np.array(values, dtype=np.float64)
    n, mean = len(array), float(array.mean())
    sd, half = math.nan, math.nan
    if n > 1:
        from scipy.special import stdtrit

        sd = float(array.std(ddof=1))
        half = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2)) * sd / math.sqrt(n)
    median = float(np.median(array))
    found = (mean, mean - half, mean + half, sd, float(array.min()), median, float(array.max()))
    return dict(zip(NUMBERS, found, strict=True))


def wilson_interval(hits: int, n: int) -> tuple[float, float]:
    """The 95 % score interval of a rate (Wilson, J. Am. Stat. Assoc. 1927); NaN if n = 0."""
    if not n:
        return math.nan, math.nan
    rate, z2 = hits / n, Z * Z
    middle = (rate + z2 / (2 * n)) / (1 + z2 / n)
    half = Z / (1 + z2 / n) * math.sqrt(rate * (1 - rate) / n + z2 / (4 * n * n))
    # With no or only hits the interval ends at exactly 0 or 1, which rounding would miss by an ulp.
    return (0.0 if hits == 0 else middle - half, 1.0 if hits == n else middle + half)
