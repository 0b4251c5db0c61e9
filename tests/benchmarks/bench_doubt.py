"""The measure of doubt on right and wrong maps of places made by seed, none of which it was calibrated on.

A map is right where no loop is off by more than half a metre and the path is as accurate as it should be; wrong where a loop is
off by more than a metre. Maps in between count for nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from gridslam.core import poses as se2
from gridslam.lidar_slam.map_consistency.assessment import DOUBTFUL, assess_map
from gridslam.lidar_slam.map_consistency.passages import distance_driven
from tests.benchmarks.bench_places import ape_rmse
from tests.benchmarks.harness import Row, say
from tests.benchmarks.tracked_places import place_of, tracked_place
from tests.benchmarks.wrong_maps import loop_graph, maps_of

SEEDS = range(15)
TRAVEL_M = 1000.0
RIGHT_M, WRONG_M = 0.5, 1.0
APE_RATIO = {True: 0.001, False: 0.003}  # of a right map, indoors and outdoors

Floats = NDArray[np.float64]


def rows() -> Iterator[Row]:
    """Area under the ROC curve, wrong maps that pass, right maps that are doubted."""
    doubts: dict[bool, list[float]] = {True: [], False: []}
    for seed in SEEDS:
        kind, _ = place_of(seed)
        place = tracked_place(kind, seed, TRAVEL_M)
        for name, poses in maps_of(loop_graph(place), seed):
            off = largest_loop_error(poses, place.truth)
            accurate = ape_rmse(poses, place.truth) <= APE_RATIO[kind != "campus"] * TRAVEL_M
            is_right = off <= RIGHT_M and accurate
            if not (is_right or off > WRONG_M):
                continue
            doubt = assess_map(place.scans, poses, place.track).doubt
            doubts[is_right].append(doubt)
            mark = "" if (doubt > DOUBTFUL) != is_right else "  <- missed"
            say(f"{kind} {seed}, {name}: largest loop error {off:.2f} m, doubt {doubt:.3f}{mark}")
    right, wrong = doubts[True], doubts[False]
    say(
        f"doubt: {len(right)} right maps up to {max(right):.3f}, {len(wrong)} wrong ones from {min(wrong):.3f}"
    )
    yield Row("doubt.roc_area", roc_area(right, wrong), "", 0.97, at_least=True)
    yield Row("doubt.missed", sum(d <= DOUBTFUL for d in wrong), f"of {len(wrong)} wrong maps", 0)
    yield Row("doubt.false_alarms", sum(d > DOUBTFUL for d in right), f"of {len(right)} right maps", 1)


def largest_loop_error(estimated: Floats, truth: Floats) -> float:
    """The largest error (m) of the relative position of two poses at the same place, far apart along the path."""
    travel = distance_driven(truth)
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
