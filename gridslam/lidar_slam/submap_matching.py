"""Matches of key scans against submaps: loops found by search, and all submaps in view of a scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.correlative_matching import SearchWindow, correlate_all
from gridslam.kernels.surfel_registration import MapScanPairs, Registration, register_pairs
from gridslam.kernels.tiles import ScanSet
from gridslam.lidar_slam.config import LoopClosureConfig
from gridslam.lidar_slam.scans import PreparedScan, scan_set
from gridslam.lidar_slam.submaps import SubmapSpan, build_submaps, likelihood_pyramid, submap_spans
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SUBMAP_KEY_SCANS = 30  # in a submap; neighbouring submaps share half of them
SUBMAP_CELL_M = 0.2
MATCHING_POINTS = 120  # of a key scan, at most
SEARCH_STRIDE = (
    4  # every fourth key scan is searched for in distant submaps: neighbours would find the same loop
)
FIELD_CELL_M = 0.1  # of the likelihood field that the search uses
YAW_STEP_RAD = FIELD_CELL_M / 8.0  # moves a point 8 m away by one cell
MAX_FIELD_VALUE = 255.0
MIN_MATCH_SCORE = 0.6  # mean likelihood of the points of a loop
MIN_INLIER_RATIO = 0.6  # fraction of a scan's points that must lie on the submap
INFORMATION_WEIGHT = 0.03  # of a match: the errors of neighbouring points are not independent
REGISTRATION = Registration(
    sigma_m=0.05,
    max_correspondence_m=0.3,  # the error of the poses after the search
    final_correspondence_m=0.1,
    max_iterations=15,
    min_correspondences=0.0,
)
WEAK_PRIOR = np.diag(
    [1.0 / 0.3**2, 1.0 / 0.3**2, 1.0 / 0.05**2]
)  # holds the direction along a corridor, which the scan does not determine


@dataclass(frozen=True, slots=True)
class SubmapMatcher:
    """Matches the key scans against submaps of themselves.

    Raises MethodError in its methods if the submaps would exceed the memory limit.
    """

    scans: Sequence[PreparedScan]
    points: ScanSet
    spans: Sequence[SubmapSpan]
    config: LoopClosureConfig
    memory_limit_mb: float

    @staticmethod
    def of(scans: Sequence[PreparedScan], config: LoopClosureConfig, memory_limit_mb: float) -> SubmapMatcher:
        """A matcher of these key scans."""
        points = scan_set([scan.subset(MATCHING_POINTS) for scan in scans])
        return SubmapMatcher(
            scans, points, submap_spans(len(scans), SUBMAP_KEY_SCANS), config, memory_limit_mb
        )

    def search_loops(self, poses: Floats) -> tuple[Edges, int]:
        """Loops between key scans and submaps that are near in space but not in time, and the number of pairs searched.

        `poses` `(n, 3)` are the present poses of the key scans.
        """
        store = self._build(poses)
        searched = 0
        pairs_map: list[int] = []
        pairs_scan: list[int] = []
        starts: list[Floats] = []
        for index, span in enumerate(self.spans):
            keys = self._loop_candidates(span, poses)
            if not len(keys):
                continue
            found, scores = self._correlate(span, keys, poses)
            searched += len(keys)
            for k in np.flatnonzero(scores > 0.0):
                pairs_map.append(index)
                pairs_scan.append(int(keys[k]))
                starts.append(found[k])
        if not starts:
            return Edges.none(), searched
        pairs = MapScanPairs(np.array(pairs_map), np.array(pairs_scan), np.array(starts))
        return self._register(store, pairs), searched

    def match_in_view(self, poses: Floats) -> Edges:
        """Matches of every key scan against all submaps near its pose `(n, 3)`, except those that contain it."""
        store = self._build(poses)
        keys = np.arange(len(self.scans))
        maps, chosen = [], []
        for index, span in enumerate(self.spans):
            near = np.hypot(*(poses[:, :2] - poses[span.centre, :2]).T) < self.config.search_radius_m
            outside = (keys < span.first) | (keys > span.last)
            found = keys[near & outside]
            maps.append(np.full(len(found), index))
            chosen.append(found)
        pair_maps, pair_scans = np.concatenate(maps), np.concatenate(chosen)
        if not len(pair_maps):
            return Edges.none()
        starts = se2.between(poses[self._centres[pair_maps]], poses[pair_scans])
        return self._register(store, MapScanPairs(pair_maps, pair_scans, starts))

    @property
    def _centres(self) -> Ints:
        """Indices `(s,)` of the key scans whose frames are the submaps'."""
        return np.array([span.centre for span in self.spans])

    def _build(self, poses: Floats) -> TileStore:
        return build_submaps(self.spans, self.scans, poses, SUBMAP_CELL_M, self.memory_limit_mb)

    def _loop_candidates(self, span: SubmapSpan, poses: Floats) -> Ints:
        """Every `SEARCH_STRIDE`-th key scan that is near the submap in space, and more than a submap away in time."""
        keys = np.arange(0, len(self.scans), SEARCH_STRIDE)
        away = (keys < span.first - SUBMAP_KEY_SCANS) | (keys > span.last + SUBMAP_KEY_SCANS)
        near = np.hypot(*(poses[keys, :2] - poses[span.centre, :2]).T) < self.config.search_radius_m
        return np.asarray(keys[away & near])

    def _correlate(self, span: SubmapSpan, keys: Ints, poses: Floats) -> tuple[Floats, Floats]:
        """Best poses `(k, 3)` of key scans in a submap's frame by correlative matching, and their scores `(k,)`."""
        centre = poses[span.centre]
        members = slice(span.first, span.last + 1)
        pyramid = likelihood_pyramid(self.scans[members], se2.between(centre, poses[members]), FIELD_CELL_M)
        first_point = self.points.first_point
        chosen = [self.points.points[first_point[k] : first_point[k + 1]] for k in keys]
        first = np.zeros(len(keys) + 1, np.int64)
        np.cumsum([len(c) for c in chosen], out=first[1:])
        window = SearchWindow(
            self.config.window_m, YAW_STEP_RAD, int(np.ceil(self.config.window_rad / YAW_STEP_RAD))
        )
        starts = se2.between(centre, poses[keys])
        found, scores = correlate_all(
            pyramid, np.vstack(chosen), first, starts, window, MAX_FIELD_VALUE * MIN_MATCH_SCORE
        )
        return found, scores

    def _register(self, store: TileStore, pairs: MapScanPairs) -> Edges:
        """Edges from the submaps' key scans to the registered ones; poor matches are left out."""
        found, information, inlier_ratio = register_pairs(
            store.maps, self.points, pairs, WEAK_PRIOR, REGISTRATION
        )
        good = inlier_ratio >= MIN_INLIER_RATIO
        return Edges(
            self._centres[pairs.maps[good]],
            pairs.scans[good],
            found[good],
            INFORMATION_WEIGHT * information[good],
            np.ones(int(good.sum()), np.bool_),
        )
