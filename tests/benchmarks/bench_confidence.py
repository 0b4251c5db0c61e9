"""How often poses that were called localized, or had some confidence, are within half a metre of the truth.

Drives by seed from an unknown start, a quarter of a minute each: ordinary places, crowds, changed places, the map of another
place (where every pose is wrong), and corridors that look the same from both ends. GRIDSLAM_CONFIDENCE_DRIVES=200 in the
environment measures 200 drives.
`python -m tests.benchmarks.bench_confidence 200` does so too, prints tables by kind and by confidence, and draws the reliability
diagram; `... bench_confidence 82 282` does it for the drives 82 to 281. It keeps each drive's poses in out/confidence, so that it
may be stopped and called again, or first be called for parts; delete the folder after a change of the method.
"""

from __future__ import annotations

import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.localization_drives import (
    LocalizationDrive,
    corridor_drive,
    errors_m,
    localized,
    place_drive,
)

DRIVES = int(os.environ.get("GRIDSLAM_CONFIDENCE_DRIVES", "10"))
FIRST_SEED = 1000
TRAVEL_M = 10.0
WITHIN_M = 0.5
EDGES = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
KINDS = ("ordinary", "crowd", "changed", "wrong map", "symmetric")
PICTURE, KEPT = Path("out") / "confidence.png", Path("out") / "confidence"

Floats = NDArray[np.float64]


def rows() -> Iterator[BenchmarkRow]:
    """The fraction of the poses called localized that are right, and of right poses that are called so."""
    found = measured(DRIVES)
    called, confidence, error = (np.concatenate([f[i] for f in found.values()]) for i in range(3))
    right = error <= WITHIN_M
    yield BenchmarkRow("confidence.localized_right", float(right[called > 0].mean()), "")
    yield BenchmarkRow("confidence.right_localized", float(called[right].mean()), "")
    yield BenchmarkRow("confidence.calibration_error", calibration_error(confidence, right), "")


def measured(drives: int) -> dict[str, Floats]:
    """By kind, the rows of `measured_drive` of the first drives."""
    found: defaultdict[str, list[Floats]] = defaultdict(list)
    for number in range(drives):
        found[KINDS[number % len(KINDS)]].append(measured_drive(number))
    return {kind: np.concatenate(parts, axis=1) for kind, parts in found.items()}


def measured_drive(number: int) -> Floats:
    """Rows `(3, n)` of a drive: whether a pose was called localized, its confidence, and its error (m)."""
    kind, seed = KINDS[number % len(KINDS)], FIRST_SEED + number
    drive, grid = drive_of(kind, seed)
    result = localized(drive, grid.grid, seed)
    error, called = errors_m(result, drive.truth)
    if kind == "wrong map":
        error = np.full(len(error), np.inf)
    confidence = result.series["confidence"].values[-len(error) :]
    wrong = int((error[called] > WITHIN_M).sum())
    say(
        f"{number} {kind}, {drive.name}: called localized {called.sum()} of {len(error)}, of these wrong {wrong}; "
        f"status {'complete' if result.doubt is None else result.doubt.status}"
    )
    return np.stack([called.astype(np.float64), confidence, error])


def kept_drive(number: int) -> Floats:
    """The same, from the folder of kept drives where it is there."""
    file = KEPT / f"{number}.npy"
    if not file.is_file():
        KEPT.mkdir(parents=True, exist_ok=True)
        np.save(file, measured_drive(number))
    return np.asarray(np.load(file, allow_pickle=False), np.float64)


def drive_of(kind: str, seed: int) -> tuple[LocalizationDrive, LocalizationDrive]:
    """The drive of a seed, and the one whose map is given."""
    if kind == "symmetric":
        drive = corridor_drive(seed)
        return drive, drive
    drive = place_drive(seed, TRAVEL_M, crowd=kind == "crowd", changed=kind == "changed")
    return drive, place_drive(seed + 5000, TRAVEL_M) if kind == "wrong map" else drive


def calibration_error(confidence: Floats, right: NDArray[np.bool_]) -> float:
    """Mean difference of confidence and fraction of right poses over bins of confidence, weighted by their poses."""
    bins = np.digitize(confidence, EDGES[1:-1])
    parts = [bins == b for b in range(len(EDGES) - 1)]
    return float(
        sum(p.sum() * abs(confidence[p].mean() - right[p].mean()) for p in parts if p.any()) / len(right)
    )


def main(first: int, end: int) -> None:
    """Measure the drives from `first` to `end` - 1, print their tables, and draw their diagram."""
    parts: defaultdict[str, list[Floats]] = defaultdict(list)
    for number in range(first, end):
        parts[KINDS[number % len(KINDS)]].append(kept_drive(number))
    report({kind: np.concatenate(each, axis=1) for kind, each in parts.items()})


def report(found: dict[str, Floats]) -> None:
    """Print the tables, and draw the diagram."""
    head = "| drives | poses | within 0.5 m | called localized | of these within 0.5 m | of those within 0.5 m called so |"
    lines = [head, "|---|---|---|---|---|---|"]
    every = {**found, "all": np.concatenate(list(found.values()), axis=1)}
    for kind, (called, _, error) in every.items():
        is_right, is_called = error <= WITHIN_M, called > 0
        both = int((is_right & is_called).sum())
        lines.append(
            f"| {kind} | {len(error)} | {is_right.sum()} | {is_called.sum()} | {percent(both, is_called)} | "
            f"{percent(both, is_right)} |"
        )
    _, confidence, error = every["all"]
    lines += ["", "| confidence | poses | within 0.5 m |", "|---|---|---|"]
    bins = np.digitize(confidence, EDGES[1:-1])
    fractions = []
    for b, (low, high) in enumerate(pairwise(EDGES)):
        inside = error[bins == b] <= WITHIN_M
        fractions.append(inside.mean() if len(inside) else np.nan)
        if len(inside):
            lines.append(f"| {low:.1f} to {high:.1f} | {len(inside)} | {100.0 * inside.mean():.1f} % |")
    lines += ["", f"calibration error {calibration_error(confidence, error <= WITHIN_M):.3f}"]
    print("\n".join(lines))  # noqa: T201
    draw(np.array(fractions))


def percent(count: int, of: NDArray[np.bool_]) -> str:
    """The percentage of the true values of a mask that are counted."""
    return f"{100.0 * count / of.sum():.2f} %" if of.any() else "-"


def draw(fractions: Floats) -> None:
    """The reliability diagram."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(4.5, 4.0), dpi=120, layout="constrained")
    axes.bar(EDGES[:-1], np.nan_to_num(fractions), 0.1, align="edge", color="tab:blue", edgecolor="white")
    axes.plot([0, 1], [0, 1], "--", color="0.3", label="confidence = fraction")
    axes.set(xlabel="confidence", ylabel="fraction of poses within 0.5 m", xlim=(0, 1), ylim=(0, 1))
    axes.legend(loc="upper left", frameon=False)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE)


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:]] or [DRIVES]
    main(*(numbers if len(numbers) == 2 else (0, numbers[0])))
