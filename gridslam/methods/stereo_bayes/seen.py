"""Which cells of the map were seen: the free space around the robot, and the surfaces that bound it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FREE_BELOW = 0.35
_CORNERS_TOUCH = np.ones((3, 3), int)


def seen_cells(
    probability: Floats, reached: Mask, eyes: NDArray[np.int64], near: float, surface: float
) -> Mask:
    """The cells `(rows, cols)` to which a ray came and that hang together with where the rays began.

    A false match behind a wall, in a frame before the wall was known, lets a ray come to cells that nothing can see: they
    are no part of the free space that begins within `near` cells of one of the `eyes` `(n, 2)` (row, col). Of what is not
    free only what lies within `surface` cells of that space is seen.
    """
    free = reached & (probability < _FREE_BELOW)
    regions, _ = label(free, _CORNERS_TOUCH)
    beside = np.ones(free.shape, bool)
    beside[eyes[:, 0], eyes[:, 1]] = False
    begins = np.unique(regions[distance_transform_edt(beside) <= near])
    room = np.isin(regions, begins[begins > 0])
    if not room.any():
        return reached
    return np.asarray(reached & (distance_transform_edt(~room) <= surface))
