"""stereo-bayes: the three likelihoods and a plain inverse sensor model, at growing rates of false matches.

Rooms by ray casting (`room`) and rendered drives (`drive`), seeds 0 to 19 of each (`GRIDSLAM_BENCH_SEEDS` takes fewer);
100 and up were used for tuning.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.stereo_models import BayesModel
from tests.benchmarks.stereo_trials import (
    MapScore,
    Stage,
    config_of,
    drive_stage,
    mean_interval,
    room_stage,
    score_of,
    scores_of,
)

SEEDS = range(int(os.environ.get("GRIDSLAM_BENCH_SEEDS", "20")))
FALSE_MATCH_RATES = (0.0, 0.05, 0.1, 0.2)
STAGES: Mapping[str, Callable[[int, float], Stage]] = {"room": room_stage, "drive": drive_stage}


def rows() -> Iterator[BenchmarkRow]:
    """The mean of each figure over the rooms; the intervals go to stderr."""
    for kind in STAGES:
        yield from likelihood_rows(kind)
    yield from blur_rows()
    yield from beyond_rows()


def likelihood_rows(kind: str) -> Iterator[BenchmarkRow]:
    """All models on the same rays, room by room."""
    scores: dict[float, dict[str, list[MapScore]]] = {rate: defaultdict(list) for rate in FALSE_MATCH_RATES}
    for seed in SEEDS:
        for rate in FALSE_MATCH_RATES:
            for name, score in scores_of(STAGES[kind](seed, rate)).items():
                scores[rate][name].append(score)
    for rate in FALSE_MATCH_RATES:
        yield from rows_of(f"stereo_bayes.{kind}.false_{round(100 * rate):02d}", rate, scores[rate])


def rows_of(label: str, rate: float, scores: Mapping[str, list[MapScore]]) -> Iterator[BenchmarkRow]:
    """One rate of false matches."""
    chain = [s.log_loss for s in scores["chain"]]
    for name, found in scores.items():
        losses, ious = [s.log_loss for s in found], [s.iou for s in found]
        lost, certain, pieces = (sum(getattr(s, key) for s in found) for key in ("lost", "certain", "pieces"))
        worse = np.subtract(losses, chain)
        low, high = mean_interval(worse)
        say(
            f"{label} {name}: log-loss {np.mean(losses):.4f}, IoU {np.mean(ious):.3f}, pieces of obstacles certain {certain} "
            f"of {pieces}, lost {lost} frames; log-loss minus the chain's {np.mean(worse):+.4f} [{low:+.4f}, {high:+.4f}]"
        )
        yield BenchmarkRow(f"{label}.{name}.log_loss", float(np.mean(losses)), "nat")
        yield BenchmarkRow(f"{label}.{name}.iou", float(np.mean(ious)), "")
        yield BenchmarkRow(f"{label}.{name}.sure", 100.0 * certain / pieces, "%")
        yield BenchmarkRow(f"{label}.{name}.lost", float(lost), "frames")
        if name != "chain" and rate >= 0.05:
            yield BenchmarkRow(f"{label}.{name}.worse_than_chain", low, "nat", 0.0, at_least=True)


def blur_rows() -> Iterator[BenchmarkRow]:
    """Poses with errors of 5 cm and 2 degrees, with and without averaging over the pose."""
    with_blur, without = config_of(), config_of("method.advanced.pose.blur=false")
    pairs = []
    for seed in SEEDS:
        stage = room_stage(seed, 0.05, noisy=True)
        pairs.append([score_of(stage, BayesModel(config)).log_loss for config in (with_blur, without)])
    losses = np.array(pairs)
    worse = losses[:, 1] - losses[:, 0]
    low, high = mean_interval(worse)
    say(f"stereo_bayes.blur: log-loss without minus with {worse.mean():+.4f} [{low:+.4f}, {high:+.4f}]")
    yield BenchmarkRow("stereo_bayes.blur.with.log_loss", float(losses[:, 0].mean()), "nat")
    yield BenchmarkRow("stereo_bayes.blur.without.log_loss", float(losses[:, 1].mean()), "nat")
    yield BenchmarkRow("stereo_bayes.blur.gain", low, "nat", 0.0, at_least=True)


def beyond_rows() -> Iterator[BenchmarkRow]:
    """Adaptive correlation and neighbouring rays against the plain chain, 10 % false matches."""
    alone = "method.advanced.correlation.across_rays=0"
    configs = {
        "adaptive": config_of(alone, "method.advanced.correlation.mode=adaptive"),
        "across_rays": config_of("method.advanced.correlation.across_rays=0.5"),
    }
    for kind, stage_of in STAGES.items():
        gains: dict[str, list[float]] = {name: [] for name in configs}
        for seed in SEEDS:
            stage = stage_of(seed, 0.1)
            plain = score_of(stage, BayesModel(config_of(alone))).log_loss
            for name, config in configs.items():
                gains[name].append(plain - score_of(stage, BayesModel(config)).log_loss)
        for name, gained in gains.items():
            low, high = mean_interval(np.array(gained))
            say(f"stereo_bayes.{kind}.{name}: gain over the plain chain [{low:+.4f}, {high:+.4f}]")
            yield BenchmarkRow(f"stereo_bayes.{kind}.{name}.gain", float(np.mean(gained)), "nat")
