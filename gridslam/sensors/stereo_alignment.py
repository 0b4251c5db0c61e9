"""Whether the pictures of a stereo pair fit together: row offset and sign of the disparities, measured on matched features."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Grey = NDArray[np.uint8]

FEATURES = 1000
MIN_MATCHES = 30  # number of matches on common rows that a statement about the pair needs
MAX_ROW_OFFSET = 0.15  # largest row offset searched for, as a fraction of the rows
ROW_TOLERANCE_PX = 1.5  # largest difference of rows of matches on common rows
FAST_THRESHOLD = 8  # threshold of the corner detector; low, for pictures with little contrast


@dataclass(frozen=True, slots=True)
class StereoAlignment:
    """Row of a point in the right picture minus that in the left one (px), the median disparity (px), and the matches.

    `inlier_ratio` is the fraction of the matches that agree with the row offset.
    """

    row_offset_px: float
    disparity_px: float
    matches: int
    inlier_ratio: float


def measured_alignment(left: Grey, right: Grey) -> StereoAlignment | None:
    """The alignment of two grey pictures `(rows, cols)`; None if too few features match."""
    detector = cv2.ORB.create(nfeatures=FEATURES, fastThreshold=FAST_THRESHOLD)
    points, descriptors = zip(
        *(detector.detectAndCompute(np.ascontiguousarray(picture), None) for picture in (left, right)),
        strict=True,
    )
    if any(found is None for found in descriptors):
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(*descriptors)
    steps = np.array(
        [np.subtract(points[0][m.queryIdx].pt, points[1][m.trainIdx].pt) for m in matches], np.float64
    ).reshape(-1, 2)
    steps = steps[np.abs(steps[:, 1]) < MAX_ROW_OFFSET * len(left)]
    if len(steps) < MIN_MATCHES:
        return None
    offsets = np.sort(-steps[:, 1])
    agreeing = np.searchsorted(offsets, offsets + 2.0 * ROW_TOLERANCE_PX, "right") - np.arange(len(offsets))
    first = int(np.argmax(agreeing))
    offset = float(np.median(offsets[first : first + agreeing[first]]))
    is_inlier = np.abs(-steps[:, 1] - offset) <= ROW_TOLERANCE_PX
    if is_inlier.sum() < MIN_MATCHES:
        return None
    return StereoAlignment(
        row_offset_px=float(np.median(-steps[is_inlier, 1])),
        disparity_px=float(np.median(steps[is_inlier, 0])),
        matches=int(is_inlier.sum()),
        inlier_ratio=float(is_inlier.mean()),
    )
