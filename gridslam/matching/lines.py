"""Straight lines: in the points of a scan by RANSAC, in a drawing by the probabilistic Hough transform (handmap-slam, 6.2)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry

Floats = NDArray[np.float64]

MAX_FAILURES = 3  # draws whose best line falls apart into runs that are too short
_ANGLE_STEP_RAD = np.pi / 180.0


@dataclass(frozen=True, slots=True)
class LineSegments:
    """Line segments: `starts` and `ends` `(k, 2)` in metres."""

    starts: Floats
    ends: Floats

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def directions_rad(self) -> Floats:
        """Directions `(k,)` modulo pi, in [0, pi)."""
        along = self.ends - self.starts
        return np.asarray(np.mod(np.arctan2(along[:, 1], along[:, 0]), np.pi))

    @property
    def lengths_m(self) -> Floats:
        """Lengths `(k,)`."""
        return np.asarray(np.hypot(*(self.ends - self.starts).T))

    def longer_than(self, length_m: float) -> LineSegments:
        """The segments of at least this length."""
        kept = self.lengths_m >= length_m
        return LineSegments(self.starts[kept], self.ends[kept])

    def distances_to(self, points: Floats) -> Floats:
        """Distances `(n, k)` of points `(n, 2)` to the segments."""
        along = self.ends - self.starts
        squared = np.maximum((along**2).sum(axis=1), 1e-12)
        off = points[:, None] - self.starts
        fraction = np.clip((off * along).sum(axis=2) / squared, 0.0, 1.0)
        return np.asarray(np.hypot(*np.moveaxis(off - fraction[..., None] * along, 2, 0)))

    @staticmethod
    def none() -> LineSegments:
        """No segments."""
        return LineSegments(np.zeros((0, 2)), np.zeros((0, 2)))


def difference_modulo_pi(a: Floats | float, b: Floats | float) -> Floats:
    """Difference a - b (rad) of directions of lines, elementwise, in [-pi/2, pi/2)."""
    return np.asarray(np.mod(np.asarray(a) - b + 0.5 * np.pi, np.pi) - 0.5 * np.pi)


def ransac_lines(
    points: Floats,
    tolerance_m: float,
    min_points: int,
    max_lines: int,
    hypotheses: int,
    rng: np.random.Generator,
    gap_m: float = 1.0,
) -> LineSegments:
    """Lines of a scan's points `(m, 2)`, the best supported first; each is fitted to its points by least squares.

    The line with most points within `tolerance_m` (m) is taken with its points, one after the other, up to `max_lines` of at
    least `min_points` points; each is the best of `hypotheses` lines through pairs of points that `rng` draws (Fischler and
    Bolles 1981). A line ends where its points do, and where there is none for `gap_m`: what else lies in line with it is
    another wall, or chance.
    """
    left = points
    starts: list[Floats] = []
    ends: list[Floats] = []
    tries = 0
    while len(starts) < max_lines and len(left) >= min_points:
        inliers = _best_support(left, tolerance_m, hypotheses, rng)
        if int(inliers.sum()) < min_points:
            break
        centre, direction = _fitted(left[inliers])
        off = left - centre
        along = off @ direction
        inliers = np.abs(off[:, 0] * direction[1] - off[:, 1] * direction[0]) < tolerance_m
        inliers[inliers] = _longest_run(along[inliers], gap_m)
        if int(inliers.sum()) < min_points:
            tries += 1
            if tries > MAX_FAILURES:
                break
            continue
        starts.append(centre + along[inliers].min() * direction)
        ends.append(centre + along[inliers].max() * direction)
        left = left[~inliers]
    return LineSegments(np.array(starts), np.array(ends)) if starts else LineSegments.none()


def _best_support(
    points: Floats, tolerance_m: float, hypotheses: int, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Mask `(m,)` of the points near the best of `hypotheses` lines through two random points each."""
    n = len(points)
    first = rng.integers(0, n, hypotheses)
    second = (first + rng.integers(1, n, hypotheses)) % n
    along = points[second] - points[first]
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    distance = np.abs(points @ normal.T - (points[first] * normal).sum(axis=1))
    near = distance < tolerance_m
    return np.asarray(near[:, int(near.sum(axis=0).argmax())])


def _longest_run(along: Floats, gap_m: float) -> NDArray[np.bool_]:
    """Of places `(m,)` on a line those of the longest run without a gap."""
    order = np.argsort(along, kind="stable")
    run = np.concatenate([[0], np.cumsum(np.diff(along[order]) > gap_m)]) if len(along) else order
    kept = np.zeros(len(along), np.bool_)
    if len(along):
        kept[order[run == np.bincount(run).argmax()]] = True
    return kept


def _fitted(points: Floats) -> tuple[Floats, Floats]:
    """Centre and unit direction of the line with least squared distances to the points."""
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
    return centre, axes[0]


def hough_segments(
    walls: NDArray[np.bool_], geometry: GridGeometry, min_length_m: float, gap_m: float, votes: int
) -> LineSegments:
    """Line segments in drawn walls `(rows, cols)` by OpenCV's probabilistic Hough transform, in the drawing's frame."""
    step = geometry.resolution_m
    found = cv2.HoughLinesP(
        np.ascontiguousarray(walls, dtype=np.uint8),
        1.0,
        _ANGLE_STEP_RAD,
        votes,
        minLineLength=min_length_m / step,
        maxLineGap=gap_m / step,
    )
    if found is None:
        return LineSegments.none()
    cells = np.asarray(found, dtype=np.float64).reshape(-1, 4)
    start, end = cells[:, :2][:, ::-1].astype(np.int64), cells[:, 2:][:, ::-1].astype(np.int64)
    return LineSegments(geometry.centres(start), geometry.centres(end))
