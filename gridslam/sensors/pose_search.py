"""Where on the whole map could this have been seen from? An exhaustive search, then a fine one about the best.

This is the proposal by which a filter starts without a start pose, and finds back when it is lost (Thrun et al. 2001, the dual of
Monte Carlo localization): poses are drawn from the measurement instead of the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.likelihood_field import sum_over_offsets
from gridslam.sensors.likelihood_field import DistanceField, Table

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Grain of the search. `most_poses` bounds the first stage: on larger maps its spacing grows."""

    spacing_m: float
    headings: int
    sigma_m: float
    points: int
    most_poses: int
    refined: int
    hypotheses: int
    apart_m: float
    apart_rad: float


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """Poses `(k, 3)` with their log-likelihoods `(k,)`, best first, no two of them alike."""

    poses: Floats
    scores: Floats


class PoseSearch:
    """Searches one map; the coarse field and the places to try are made once."""

    def __init__(self, field: DistanceField, free: NDArray[np.bool_], settings: SearchSettings) -> None:
        self._field = field
        self._settings = settings
        step = field.geometry.resolution_m
        self._block = max(round(0.5 * settings.sigma_m / step), 1)
        self._cell_m = self._block * step
        nearest = _block_reduce(field.steps, self._block, np.minimum, 255)
        distances = field.distances_m[nearest]
        worth = np.rint(255.0 * np.exp(-0.5 * (distances / settings.sigma_m) ** 2)).astype(np.uint8)
        worth[nearest == 255] = 0
        self._worth = worth
        self._places = self._places_to_try(free)

    def best(self, points: Floats, table: Table) -> Hypotheses:
        """The hypotheses about the robot's pose that explain points `(m, 2)` of its frame best; scored with the table."""
        settings = self._settings
        coarse = points if len(points) <= settings.points else points[_evenly(len(points), settings.points)]
        return self.refine(self._coarse_poses(coarse), points, table)

    def refine(self, poses: Floats, points: Floats, table: Table) -> Hypotheses:
        """Climb from each pose to the best one nearby, and keep one of those that end alike."""
        settings = self._settings
        in_xy, in_yaw = 0.5 * self._cell_m, np.pi / settings.headings
        scores = self._field.sums(table, points, poses)
        for _ in range(5):
            poses, scores = climb(
                lambda tried: self._field.sums(table, points, tried), poses, scores, in_xy, in_yaw
            )
            poses, scores = best_apart(poses, scores, in_xy, in_yaw, settings.refined)
            in_xy, in_yaw = 0.6 * in_xy, 0.6 * in_yaw
        return Hypotheses(
            *best_apart(poses, scores, settings.apart_m, settings.apart_rad, settings.hypotheses)
        )

    def _coarse_poses(self, points: Floats) -> Floats:
        """The best poses `(k, 3)` of the exhaustive stage."""
        settings = self._settings
        geometry = self._field.geometry
        pad = int(np.ceil(np.hypot(points[:, 0], points[:, 1]).max() / self._cell_m)) + 2
        padded = np.pad(self._worth, pad)
        width = padded.shape[1]
        headings = np.arange(settings.headings) * (2.0 * np.pi / settings.headings)
        cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
        cols = np.rint((cos * points[:, 0] - sin * points[:, 1]) / self._cell_m).astype(np.int32)
        rows = np.rint((sin * points[:, 0] + cos * points[:, 1]) / self._cell_m).astype(np.int32)
        starts = ((self._places[:, 0] + pad) * width + self._places[:, 1] + pad).astype(np.int32)
        scores = sum_over_offsets(padded.ravel(), starts, rows * width + cols).ravel()
        keep = min(settings.refined, len(scores))
        # Ties at the bar would be kept in an order of argpartition's own: take all above, then the first ones at the bar.
        bar = np.partition(scores, len(scores) - keep)[len(scores) - keep]
        above = np.flatnonzero(scores > bar)
        chosen = np.r_[above, np.flatnonzero(scores == bar)[: keep - len(above)]]
        cells = self._places[chosen % len(starts)]
        local = (cells[:, ::-1] + 0.5) * self._cell_m
        yaw = geometry.yaw_rad
        origin = np.array([*geometry.origin_xy_m, yaw])
        return se2.compose(origin, np.column_stack([local, headings[chosen // len(starts)]]))

    def _places_to_try(self, free: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Coarse cells `(n, 2)`, one for every square of the spacing that has free cells: the one farthest from walls."""
        settings = self._settings
        roomy = np.where(free, self._field.steps.astype(np.int64) + 1, 0)
        room = _block_reduce(roomy, self._block, np.maximum, 0)
        stride = max(round(settings.spacing_m / self._cell_m), 1)
        while True:
            places = _roomiest(room, stride)
            if len(places) * settings.headings <= settings.most_poses or stride >= max(room.shape):
                return places
            stride += 1


def _block_reduce(
    values: NDArray[np.generic], block: int, reduce: np.ufunc, fill: int
) -> NDArray[np.generic]:
    """Values `(rows, cols)` reduced over blocks of `block` by `block` cells, the last ones filled up."""
    rows, cols = (-(-n // block) for n in values.shape)
    full = np.full((rows * block, cols * block), fill, values.dtype)
    full[: values.shape[0], : values.shape[1]] = values
    blocks = full.reshape(rows, block, cols, block)
    return np.asarray(reduce.reduce(reduce.reduce(blocks, axis=3), axis=1))


def _roomiest(room: NDArray[np.generic], stride: int) -> NDArray[np.int64]:
    """Of every square of `stride` cells the cell with the most room, where there is any."""
    rows, cols = (-(-n // stride) for n in room.shape)
    full = np.zeros((rows * stride, cols * stride), np.int64)
    full[: room.shape[0], : room.shape[1]] = room
    squares = full.reshape(rows, stride, cols, stride).transpose(0, 2, 1, 3).reshape(rows, cols, -1)
    inside = squares.argmax(axis=2)
    row, col = np.nonzero(squares.max(axis=2) > 0)
    chosen = inside[row, col]
    return np.column_stack([row * stride + chosen // stride, col * stride + chosen % stride])


def climb(
    score: Callable[[Floats], Floats], poses: Floats, scores: Floats, in_xy: float, in_yaw: float
) -> tuple[Floats, Floats]:
    """One step of each pose `(n, 3)` to the best of its six neighbours along the axes, where that is better."""
    steps = np.zeros((6, 3))
    for axis, size in enumerate((in_xy, in_xy, in_yaw)):
        steps[2 * axis, axis], steps[2 * axis + 1, axis] = size, -size
    around = poses[:, None] + steps
    tried = score(around.reshape(-1, 3)).reshape(len(poses), 6)
    choice = tried.argmax(axis=1)
    each = np.arange(len(poses))
    best = tried[each, choice]
    better = best > scores
    return np.where(better[:, None], around[each, choice], poses), np.where(better, best, scores)


def best_apart(
    poses: Floats, scores: Floats, apart_m: float, apart_rad: float, most: int
) -> tuple[Floats, Floats]:
    """Best first, one for every bin of the given size, at most so many."""
    order = np.argsort(-scores, kind="stable")
    poses, scores = poses[order], scores[order]
    size = max(int(np.ceil(2.0 * np.pi / apart_rad)), 1)
    yaw = np.floor(np.mod(poses[:, 2], 2.0 * np.pi) / (2.0 * np.pi / size)).astype(np.int64)
    bins = np.column_stack([np.floor(poses[:, :2] / apart_m).astype(np.int64), yaw])
    _, first = np.unique(bins, axis=0, return_index=True)
    kept = np.sort(first)[:most]
    return poses[kept], scores[kept]


def _evenly(n: int, most: int) -> NDArray[np.int64]:
    return (np.arange(most) * n) // most
