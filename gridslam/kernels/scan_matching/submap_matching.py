"""Matching of one submap in another: the best pose in a whole window, its strongest rival, and its agreement with the scans.

The target submap is drawn three times: as a likelihood field for the search, as surface elements for the registration, and as
the cells that its beams have crossed, in which the query submap must have no walls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.scan_matching.seen_space import (
    SeenSpace,
    explained_and_contradicted,
    mark_beams,
    mark_near_surfaces,
)
from gridslam.kernels.scan_matching.segment_clouds import (
    SegmentClouds,
    leverage_sample,
    submap_points,
    surfel_map,
    weak_prior,
)
from gridslam.kernels.scan_matching.surfel_registration import Registration, register
from gridslam.kernels.scan_matching.window_search import (
    LEVELS,
    LikelihoodField,
    PoseWindow,
    WindowSearch,
    likelihood_field,
    search_window,
)
from gridslam.kernels.threads import run_in_ranges

MIN_POINTS = 30  # a submap with fewer is not matched


class SubmapPairs(NamedTuple):
    """Pairs of submaps to match: query k is searched for in target k.

    Target k is the segments target_first[k]..target_last[k], seen from its frame at target_poses `(., 3)` from row
    target_row[k]; the query likewise. `starts` `(k, 3)` are the queries' expected poses in the targets' frames, `windows`
    `(k, 3)` the half widths of the search about them (m, m, rad).
    """

    target_first: NDArray[np.int64]
    target_last: NDArray[np.int64]
    target_row: NDArray[np.int64]
    target_poses: NDArray[np.float64]
    query_first: NDArray[np.int64]
    query_last: NDArray[np.int64]
    query_row: NDArray[np.int64]
    query_poses: NDArray[np.float64]
    starts: NDArray[np.float64]
    windows: NDArray[np.float64]


class SubmapDrawing(NamedTuple):
    """Points taken of a query; cell and width of the likelihood field, cell of the surface elements (m)."""

    max_points: int
    field_cell_m: float
    field_sigma_m: float
    surfel_cell_m: float


class SubmapMatches(NamedTuple):
    """For each pair: whether something was found, the pose `(k, 3)`, and how good it is.

    `scores` are the mean likelihoods of the best pose of the search, `rival_scores` those of the best pose away from it;
    `information` `(k, 3, 3)` of the registered points; `explained` and `contradicted` the fractions of the query's points
    on a surface of the target and in space that the target has seen free.
    """

    poses: NDArray[np.float64]
    scores: NDArray[np.float64]
    rival_scores: NDArray[np.float64]
    information: NDArray[np.float64]
    explained: NDArray[np.float64]
    contradicted: NDArray[np.float64]


@compiled
def _field_for(
    target: NDArray[np.float64], query: NDArray[np.float64], window: PoseWindow, drawing: SubmapDrawing
) -> LikelihoodField:
    """The field of the target's points: no larger than the target, nor than what the query reaches within the window."""
    radius = np.sqrt((query[:, 0] ** 2 + query[:, 1] ** 2).max())
    margin = (1 << (LEVELS - 1)) * drawing.field_cell_m + 3.0 * drawing.field_sigma_m
    corner, cells = np.empty(2), np.empty(2, np.int64)
    for axis in range(2):
        reached = window.half_width[axis] + radius
        low = max(target[:, axis].min(), window.centre[axis] - reached) - margin
        high = min(target[:, axis].max(), window.centre[axis] + reached) + margin
        corner[axis] = low
        cells[axis] = int(max(high - low, 2.0 * margin) / drawing.field_cell_m) + 1
    field: LikelihoodField = likelihood_field(
        target, corner, cells, drawing.field_cell_m, drawing.field_sigma_m
    )
    return field


@compiled
def _match(
    clouds: SegmentClouds,
    pairs: SubmapPairs,
    k: int,
    drawing: SubmapDrawing,
    search: WindowSearch,
    registration: Registration,
    out: SubmapMatches,
) -> None:
    """Match pair k and fill in its row of `out`; where nothing is found the row is left as it is."""
    first, last = pairs.target_first[k], pairs.target_last[k]
    target_poses = pairs.target_poses[pairs.target_row[k] : pairs.target_row[k + 1]]
    target = submap_points(clouds, first, last, target_poses)
    query_poses = pairs.query_poses[pairs.query_row[k] : pairs.query_row[k + 1]]
    whole_query = submap_points(clouds, pairs.query_first[k], pairs.query_last[k], query_poses)
    if whole_query.points.shape[0] < MIN_POINTS or target.points.shape[0] < MIN_POINTS:
        return
    query = leverage_sample(whole_query, drawing.max_points)
    window = PoseWindow(pairs.starts[k], pairs.windows[k])
    field = _field_for(target.points, query.points, window, drawing)
    peaks = search_window(field, query.points, window, search)
    if peaks.score < 0.0:
        return
    surfels = surfel_map(target, drawing.surfel_cell_m)
    pose, information, _ = register(surfels, query, peaks.pose, weak_prior(peaks.pose), registration)
    seen = SeenSpace(np.zeros(field.values.shape, np.uint8), field.corner, field.cell_m)
    for segment in range(first, last + 1):
        beams = clouds.beams[clouds.first_beam[segment] : clouds.first_beam[segment + 1]]
        mark_beams(seen, beams, target_poses[segment - first])
    mark_near_surfaces(seen, target.points)
    explained, contradicted = explained_and_contradicted(
        surfels, seen, query, pose, registration.final_correspondence_m
    )
    copy_row(out.poses, k, pose)
    for row in range(3):
        copy_row(out.information[k], row, information[row])
    out.scores[k], out.rival_scores[k] = peaks.score, peaks.rival_score
    out.explained[k], out.contradicted[k] = explained, contradicted


def match_submaps(
    clouds: SegmentClouds,
    pairs: SubmapPairs,
    drawing: SubmapDrawing,
    search: WindowSearch,
    registration: Registration,
) -> SubmapMatches:
    """Every query searched for in its target; a score of -1 and the start as pose where nothing was found."""
    n = pairs.starts.shape[0]
    out = SubmapMatches(
        poses=pairs.starts.copy(),
        scores=np.full(n, -1.0),
        rival_scores=np.full(n, -1.0),
        information=np.zeros((n, 3, 3)),
        explained=np.zeros(n),
        contradicted=np.zeros(n),
    )
    run_in_ranges(_match_submaps, n, (clouds, pairs, drawing, search, registration, out))
    return out


@compiled
def _match_submaps(
    first: int,
    last: int,
    clouds: SegmentClouds,
    pairs: SubmapPairs,
    drawing: SubmapDrawing,
    search: WindowSearch,
    registration: Registration,
    out: SubmapMatches,
) -> None:
    """Fill in the items first to last - 1 of `match_submaps`."""
    for k in range(first, last):
        _match(clouds, pairs, k, drawing=drawing, search=search, registration=registration, out=out)
