"""The measure of doubt on right and wrong maps of places made by seed and of recorded logs.

Settings are calibrated on seeds from 100 on. A map is right where no loop is off by more than half a metre and the path is as
accurate as it should be; wrong where a loop is off by more than a metre or the path by three times what it may be. Maps in
between count for nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance
from gridslam.lidar_slam.map_consistency.assessment import DOUBTFUL, assess_map
from tests.benchmarks.bench_places import ape_rmse
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir
from tests.benchmarks.tracked_places import TrackedPlace, place_of, tracked_log, tracked_place
from tests.benchmarks.wrong_maps import loop_graph, maps_of

SEEDS = range(30, 40)
TRAVEL_M = 600.0
LOGS = ("aces", "mit-csail", "mit-killian")
RIGHT_M, WRONG_M = 0.5, 1.0
INDOORS, OUTDOORS = 0.001, 0.003  # path error of a right map, as a fraction of the travel
WRONG_RATIO = 3.0  # that of a wrong map, at least, over that of a right one

Floats = NDArray[np.float64]


def rows() -> Iterator[BenchmarkRow]:
    """Area under the ROC curve, wrong maps that pass, right maps that are doubted."""
    doubts: dict[bool, list[float]] = {True: [], False: []}
    for seed, (name, place, ape_ratio) in enumerate(places()):
        for made in maps_of(loop_graph(place), seed):
            off = largest_loop_error(made.poses, place.truth)
            ape = ape_rmse(made.poses, place.truth) / (ape_ratio * cumulative_distance(place.truth)[-1])
            is_right = off <= RIGHT_M and ape <= 1.0
            if not (is_right or off > WRONG_M or ape > WRONG_RATIO):
                continue
            doubt = assess_map(place.scans, made.poses, place.track, made.loops).doubt
            doubts[is_right].append(doubt)
            mark = "" if (doubt > DOUBTFUL) != is_right else "  <- missed"
            say(f"{name}, {made.name}: largest loop error {off:.2f} m, doubt {doubt:.3f}{mark}")
    right, wrong = doubts[True], doubts[False]
    say(
        f"doubt: {len(right)} right maps up to {max(right):.3f}, {len(wrong)} wrong ones from {min(wrong):.3f}"
    )
    yield BenchmarkRow("doubt.roc_area", roc_area(right, wrong), "", 0.97, at_least=True)
    yield BenchmarkRow("doubt.missed", sum(d <= DOUBTFUL for d in wrong), f"of {len(wrong)} wrong maps", 0)
    yield BenchmarkRow(
        "doubt.false_alarms", sum(d > DOUBTFUL for d in right), f"of {len(right)} right maps", 1
    )


def places() -> Iterator[tuple[str, TrackedPlace, float]]:
    """Names, places, and the path error of a right map; places made by seed, then the recorded logs, where they are."""
    for seed in SEEDS:
        kind, _ = place_of(seed)
        yield f"{kind} {seed}", tracked_place(kind, seed, TRAVEL_M), OUTDOORS if kind == "campus" else INDOORS
    folder = data_dir()
    if folder is not None:
        for log in LOGS:
            yield log, tracked_log(folder / "lidar" / f"{log}.clf.bz2"), INDOORS


def largest_loop_error(estimated: Floats, truth: Floats) -> float:
    """The largest error (m) of the relative position of two poses at the same place, far apart along the path."""
    travel = cumulative_distance(truth)
    kept = np.flatnonzero(np.diff(np.floor(travel), prepend=-1.0) > 0)
    pairs = cKDTree(truth[kept, :2]).query_pairs(1.0, output_type="ndarray")
    first, second = kept[pairs[:, 0]], kept[pairs[:, 1]]
    loops = np.abs(travel[first] - travel[second]) > 25.0
    first, second = first[loops], second[loops]
    error = se2.between(estimated[first], estimated[second]) - se2.between(truth[first], truth[second])
    return float(np.hypot(error[:, 0], error[:, 1]).max(initial=0.0))


def roc_area(right: list[float], wrong: list[float]) -> float:
    """The chance that a wrong map has more doubt than a right one (Mann and Whitney); equal doubt counts half."""
    ranks = rankdata([*right, *wrong])
    excess = ranks[len(right) :].sum() - len(wrong) * (len(wrong) + 1) / 2
    return float(excess / (len(right) * len(wrong)))
