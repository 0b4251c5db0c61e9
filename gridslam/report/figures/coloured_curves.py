"""A path coloured by a value along it, such as its error or its speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.report.figures.chart_data import ColourScale, Curve

Floats = NDArray[np.float64]

LEVELS = 24  # number of colours of a path
WIDTH_PX = 3.0
# From dark violet through green to yellow, increasingly bright, so that the scale can also be read in grey
COLOURS = np.array(
    [
        *((68, 1, 84), (71, 44, 122), (59, 81, 139), (44, 113, 142), (33, 144, 141)),
        *((39, 173, 129), (92, 200, 99), (170, 220, 50), (253, 231, 37)),
    ]
)


def coloured_curves(points: Floats, values: Floats, label: str) -> tuple[list[Curve], ColourScale]:
    """The path through points `(n, 2)`, divided into curves of nearly equal `values` `(n,)`, and the scale of their colours.

    These are far fewer curves than one for each step of the path.
    """
    along = np.linspace(0.0, len(COLOURS) - 1.0, LEVELS)
    rgb = [np.interp(along, np.arange(len(COLOURS)), column) for column in COLOURS.T]
    colours = ["#{:02x}{:02x}{:02x}".format(*row) for row in np.rint(rgb).astype(int).T.tolist()]
    scale = ColourScale(colours, float(values.min()), float(values.max()), label)
    level = np.minimum(((values[:-1] - scale.low) / (scale.span / LEVELS)).astype(np.int64), LEVELS - 1)
    if not len(level):  # one pose has no path
        return [], scale
    starts = np.flatnonzero(np.r_[True, level[1:] != level[:-1]])
    ends = np.r_[starts[1:], len(level)]
    parts = [(points[first : last + 1], int(level[first])) for first, last in zip(starts, ends, strict=True)]
    curves = [Curve(at[:, 0], at[:, 1], colours[number], width=WIDTH_PX) for at, number in parts]
    return curves, scale
