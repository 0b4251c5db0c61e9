"""The offline final stage: loops found over the whole trajectory, and the trajectory that satisfies them.

First, key scans are searched for in submaps that they could see again, by correlative matching in a wide window; the
pose graph of these loops and the front end's steps puts the trajectory right on the large scale. Then every key scan is
registered against every submap in view, and the graph of all these matches puts it right to the centimetre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.kernels import correlative_matching, surfel_registration
from gridslam.lidar_slam.config import FinalStageConfig
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.submaps import Span, build_submaps, likelihood_pyramid, spans_of
from gridslam.lidar_slam.track import StepNoise, step_deviations
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

REGISTRATION_SIGMA_M = 0.05
SETTLED_M = 0.05  # scans that move less are not registered anew
WEAK_PRIOR = np.diag(
    [1.0 / 0.3**2, 1.0 / 0.3**2, 1.0 / 0.05**2]
)  # keeps the open direction of a corridor where it was


@dataclass(frozen=True, slots=True)
class Refinement:
    """What the stage needs to know: its settings, the noise of the front end's steps, and cell and memory of the submaps."""

    stage: FinalStageConfig
    steps: StepNoise
    resolution_m: float
    memory_limit_mb: float


@dataclass(frozen=True, slots=True)
class Refined:
    """Poses of the key scans `(n, 3)`, and what was found on the way."""

    poses: Floats
    loops_tried: int
    loops_found: int
    loops_rejected: int
    matches: int


@dataclass(frozen=True, slots=True)
class _Points:
    """The matching points of all key scans in one array: scan i owns rows first[i]..first[i + 1]."""

    points: Floats
    normals: Floats
    first: Ints


def refine(
    scans: Sequence[PreparedScan],
    poses: Floats,
    track: Floats,
    settings: Refinement,
    landmarks: Edges | None = None,
) -> Refined:
    """Refine the poses `(n, 3)` of the key scans.

    `track` `(n, 3)` are the front end's poses of the same scans, good over short ways; `landmarks` are
    further edges between them.
    """
    stage = settings.stage
    n = len(scans)
    if n < 3:
        return Refined(poses.copy(), 0, 0, 0, 0)
    points = _gather(scans, stage.max_points)
    spans = spans_of(n, stage.submap_key_scans)
    odometry = _steps(track, settings)
    if landmarks is not None and len(landmarks):
        odometry = Edges.concatenate([odometry, landmarks])
    estimate, found = poses, _no_edges()
    tried = rejected = 0
    for _ in range(stage.searches):
        before = estimate
        loops, pairs = _search_loops(scans, points, spans, before, settings)
        tried += pairs
        found = Edges.concatenate([found, loops])
        estimate, weights = optimise(before, Edges.concatenate([odometry, found]), stage.robust_scale)
        rejected = int(np.count_nonzero(weights[len(odometry) :] < 0.1))
        if _largest_move(before, estimate) < stage.search_again_m:
            break
    matches = found
    for _ in range(stage.rounds):
        before = estimate
        matches = _register_in_view(scans, points, spans, before, settings)
        estimate, _ = optimise(before, Edges.concatenate([odometry, matches]), stage.robust_scale)
        if _largest_move(before, estimate) < SETTLED_M:
            break
    return Refined(estimate, tried, len(found), rejected, len(matches))


def _largest_move(before: Floats, after: Floats) -> float:
    """How far (m) the pose that moved farthest has moved."""
    return float(np.hypot(*(after - before)[:, :2].T).max())


def _steps(track: Floats, settings: Refinement) -> Edges:
    """The front end's motions from key scan to key scan."""
    n = len(track)
    steps = se2.between(track[:-1], track[1:])
    information = (1.0 / step_deviations(steps, settings.steps) ** 2)[:, :, None] * np.eye(3)
    share = settings.stage.odometry_share
    return Edges(np.arange(n - 1), np.arange(1, n), steps, share * information, np.zeros(n - 1, np.bool_))


def _gather(scans: Sequence[PreparedScan], max_points: int) -> _Points:
    parts = [scan.subset(max_points) for scan in scans]
    first = np.zeros(len(parts) + 1, np.int64)
    np.cumsum([len(points) for points, _ in parts], out=first[1:])
    return _Points(np.vstack([p for p, _ in parts]), np.vstack([n for _, n in parts]), first)


def _search_loops(
    scans: Sequence[PreparedScan], points: _Points, spans: Sequence[Span], poses: Floats, settings: Refinement
) -> tuple[Edges, int]:
    """Loops between submaps and key scans that are near each other but not in time; and how many pairs were tried."""
    stage = settings.stage
    store = build_submaps(spans, scans, poses, settings.resolution_m, settings.memory_limit_mb)
    yaw_step = stage.field_resolution_m / 8.0
    tried = 0
    pairs_map: list[int] = []
    pairs_scan: list[int] = []
    starts: list[Floats] = []
    for index, span in enumerate(spans):
        centre = poses[span.centre]
        keys = np.arange(0, len(scans), stage.stride)
        away = (keys < span.first - stage.submap_key_scans) | (keys > span.last + stage.submap_key_scans)
        near = np.hypot(*(poses[keys, :2] - centre[:2]).T) < stage.search_radius_m
        keys = keys[away & near]
        if not len(keys):
            continue
        members = slice(span.first, span.last + 1)
        pyramid = likelihood_pyramid(
            scans[members], se2.between(centre, poses[members]), stage.field_resolution_m, 0.1, 30.0
        )
        chosen = [points.points[points.first[k] : points.first[k + 1]] for k in keys]
        first = np.zeros(len(keys) + 1, np.int64)
        np.cumsum([len(c) for c in chosen], out=first[1:])
        found, scores = correlative_matching.correlate_all(
            pyramid.levels,
            pyramid.origin_xy_m,
            pyramid.resolution_m,
            np.vstack(chosen),
            first,
            se2.between(centre, poses[keys]),
            np.full(len(keys), stage.window_m),
            yaw_step,
            np.full(len(keys), int(np.ceil(stage.window_rad / yaw_step))),
            255.0 * stage.least_score,
        )
        tried += len(keys)
        for k in np.flatnonzero(scores > 0.0):
            pairs_map.append(index)
            pairs_scan.append(int(keys[k]))
            starts.append(found[k])
    if not starts:
        return _no_edges(), tried
    edges = _register(
        store, points, spans, np.array(pairs_map), np.array(pairs_scan), np.array(starts), 0.3, stage
    )
    return edges, tried


def _register_in_view(
    scans: Sequence[PreparedScan], points: _Points, spans: Sequence[Span], poses: Floats, settings: Refinement
) -> Edges:
    """Matches of every key scan against all submaps near it, whether near in time or not."""
    stage = settings.stage
    store = build_submaps(spans, scans, poses, settings.resolution_m, settings.memory_limit_mb)
    keys = np.arange(len(scans))
    maps, chosen = [], []
    for index, span in enumerate(spans):
        near = np.hypot(*(poses[:, :2] - poses[span.centre, :2]).T) < stage.search_radius_m
        outside = (keys < span.first) | (keys > span.last)
        found = keys[near & outside]
        maps.append(np.full(len(found), index))
        chosen.append(found)
    pair_maps, pair_scans = np.concatenate(maps), np.concatenate(chosen)
    if not len(pair_maps):
        return _no_edges()
    centres = np.array([span.centre for span in spans])
    starts = se2.between(poses[centres[pair_maps]], poses[pair_scans])
    return _register(store, points, spans, pair_maps, pair_scans, starts, 0.3, stage)


def _register(
    store: TileStore,
    points: _Points,
    spans: Sequence[Span],
    maps: Ints,
    scans: Ints,
    starts: Floats,
    reach_m: float,
    stage: FinalStageConfig,
) -> Edges:
    """Register scans in submaps and keep those that fit."""
    found, information, fit = surfel_registration.register_pairs(
        store.directory,
        store.pool,
        store.origin,
        store.resolution_m,
        maps,
        points.points,
        points.normals,
        points.first,
        scans,
        starts,
        WEAK_PRIOR,
        REGISTRATION_SIGMA_M,
        reach_m,
        0.1,
        15,
        0.0,
    )
    good = fit >= stage.least_fit
    centres = np.array([span.centre for span in spans])
    return Edges(
        centres[maps[good]],
        scans[good],
        found[good],
        stage.information_share * information[good],
        np.ones(int(good.sum()), np.bool_),
    )


def _no_edges() -> Edges:
    return Edges(
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 3)),
        np.zeros((0, 3, 3)),
        np.zeros(0, np.bool_),
    )
