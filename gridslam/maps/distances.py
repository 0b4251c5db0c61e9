"""Distances of the cells of a grid to the nearest of some of them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def distances_to(cells: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance `(rows, cols)`, in cells, from each cell's centre to that of the nearest marked one; infinite without any.

    Source: Felzenszwalb and Huttenlocher 2012, as OpenCV's precise distance transform does it by itself. Intel's library, which
    OpenCV would use for small grids or on one thread, gives other last digits by where in memory the grid lies.
    """
    if not cells.any():
        return np.full(cells.shape, np.inf, np.float32)
    before = cv2.ipp.useIPP()  # of this thread
    cv2.ipp.setUseIPP(False)
    try:
        distance = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    finally:
        cv2.ipp.setUseIPP(before)
    return np.asarray(distance, np.float32)
