"""Distance transform of a grid."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def distances_to(cells: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distances `(rows, cols)` in cells from each cell's centre to that of the nearest marked cell; infinite if none is marked.

    Source: Felzenszwalb and Huttenlocher 2012, by OpenCV's own precise distance transform. Intel's library, which OpenCV would
    use for small grids or on one thread, is switched off: its last digits depend on the grid's address in memory.
    """
    if not cells.any():
        return np.full(cells.shape, np.inf, np.float32)
    before = cv2.ipp.useIPP()  # a setting of the thread
    cv2.ipp.setUseIPP(False)
    try:
        distance = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    finally:
        cv2.ipp.setUseIPP(before)
    return np.asarray(distance, np.float32)
