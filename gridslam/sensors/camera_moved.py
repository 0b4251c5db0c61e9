"""Whether a fixed camera was moved, as by a blow: then what stands still is elsewhere in its images, or at other depths.

Three signs, because each has its blind side. The depths of a floor and of parallel walls stay what they are when the camera is
shifted along them; edges in the colours do not. In a room without texture only the depths change. After a small shift, colours
change along all edges, where nothing moves.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.sensors.background import Depth, Mask

Image = NDArray[np.float32]

# Number of frames in a row that must differ: people who pass near the camera hide what stands still for a moment
FRAMES = 10
# Depths are compared by the means of squares of this size: noise of single readings is averaged out
CELL_PX = 16
MIN_KNOWN = 0.25  # fraction of a square's pixels that must have a depth and show no moving object
# By which a square's depth differs: in metres, and of the depth
DEPTH_MARGIN_M, DEPTH_MARGIN_RATIO = 0.03, 0.015
MAX_DIFFERING = 0.3  # fraction of the squares; furniture that was moved covers less
EDGE_COLS = 160  # width of the image in which edges are compared
# Correlation of the edges of successive frames, below which they are noise, and say nothing
MIN_EDGE_SCORE = 0.3
MAX_CHANGED = 0.5  # fraction of the image that is near to changed colours without a moving object
MAX_EDGE_LOSS = 0.75  # a correlation with the reference below this fraction of the usual one differs
EDGE_LIMIT = 3.0  # largest strength of an edge, in units of the mean, so that a few of them do not decide
_NEAR_PX = 15  # distance from a change within which its edges and its shadow lie
RATE = 0.02  # rate of the running means: the light and some furniture change in minutes


class PlacementCheck:
    """Compares the frames of one camera with those before."""

    def __init__(self) -> None:
        self._edges: Image | None = None
        self._edge_score: float | None = None  # usual correlation with the reference
        self._depths: Image | None = None
        self.differing = 0  # frames in a row up to now

    @property
    def is_moved(self) -> bool:
        """Whether the camera was moved."""
        return self.differing >= FRAMES

    def add(
        self, pixels: NDArray[np.uint8] | None, depth_m: Depth | None, changed: Mask, moving: Mask
    ) -> None:
        """Add a frame: colours `(rows, cols[, 3])`, depths `(rows, cols)`, or both.

        `changed` `(rows, cols)` is where the colours are not those of the background, `moving` where a moving object is.
        """
        near_changed = _widened(changed)
        differs = [(near_changed & ~_widened(moving)).mean() > MAX_CHANGED]
        if pixels is not None:
            differs.append(self._edges_differ(edges_of(pixels), near_changed))
        if depth_m is not None:
            differs.append(self._depths_differ(square_means(depth_m, moving)))
        self.differing = self.differing + 1 if any(differs) else 0

    def _edges_differ(self, edges: Image, near_changed: Mask) -> bool:
        if self._edges is None:
            self._edges = edges
            return False
        small = cv2.resize(near_changed.astype(np.uint8), edges.shape[::-1], interpolation=cv2.INTER_NEAREST)
        still = small == 0
        limit = EDGE_LIMIT * float(self._edges.mean())
        score = _correlation(np.minimum(edges, limit)[still], np.minimum(self._edges, limit)[still])
        if self._edge_score is None:
            self._edge_score = score
        if self._edge_score > MIN_EDGE_SCORE and score < MAX_EDGE_LOSS * self._edge_score:
            return True
        self._edge_score += RATE * (score - self._edge_score)
        self._edges = np.asarray(self._edges + np.float32(RATE) * (edges - self._edges), np.float32)
        return False

    def _depths_differ(self, depths: Image) -> bool:
        if self._depths is None:
            self._depths = depths
            return False
        off = depths - self._depths
        known = np.isfinite(off)
        margin = DEPTH_MARGIN_M + DEPTH_MARGIN_RATIO * self._depths
        with np.errstate(invalid="ignore"):
            if (np.abs(off) > margin).sum() > MAX_DIFFERING * max(int(known.sum()), 1):
                return True
        learned = np.where(known, self._depths + np.float32(RATE) * off, self._depths)
        self._depths = np.where(np.isnan(self._depths), depths, learned).astype(np.float32)
        return False


def edges_of(pixels: NDArray[np.uint8]) -> Image:
    """Strength `(r, c)` of the edges of pixels, `(rows, cols)` or `(rows, cols, 3)`, in a smaller grey image."""
    rows, cols = pixels.shape[:2]
    size = (min(EDGE_COLS, cols), max(round(rows * min(EDGE_COLS / cols, 1.0)), 1))
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = cv2.GaussianBlur(small if small.ndim == 2 else small.mean(axis=2), (5, 5), 0)
    along, across = (cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx) for dx in (1, 0))
    return np.asarray(cv2.magnitude(along, across))


def square_means(depth_m: Depth, moving: Mask) -> Image:
    """Mean depths of squares of `CELL_PX`; NaN where too few pixels are known and still."""
    rows, cols = (size // CELL_PX for size in depth_m.shape)
    known = np.isfinite(depth_m[: rows * CELL_PX, : cols * CELL_PX])
    known &= ~moving[: rows * CELL_PX, : cols * CELL_PX]
    depths = np.where(known, depth_m[: rows * CELL_PX, : cols * CELL_PX], np.float32(0.0))
    total, count = (
        cv2.resize(part, (cols, rows), interpolation=cv2.INTER_AREA)
        for part in (depths, known.astype(np.float32))
    )
    enough = count >= MIN_KNOWN
    return np.where(enough, total / np.maximum(count, MIN_KNOWN), np.float32(np.nan)).astype(np.float32)


def _widened(mask: Mask) -> Mask:
    """The mask `(rows, cols)` and what is near to it."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((_NEAR_PX, _NEAR_PX), np.uint8))) > 0


def _correlation(values: Image, others: Image) -> float:
    """Pearson's correlation; 0 without values."""
    if len(values) < 2:
        return 0.0
    off, others_off = values - values.mean(), others - others.mean()
    scale = float(np.sqrt(np.sum(off * off) * np.sum(others_off * others_off)))
    return float(np.sum(off * others_off)) / scale if scale > 0.0 else 0.0
