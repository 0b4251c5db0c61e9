"""Charts of curves over a value or in the plane, as data; `charts.py` draws them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.picture.ink import Canvas

Floats = NDArray[np.float64]

MIN_SCALE_SPAN = 1e-3  # smallest span of the values of a colour scale


@dataclass(frozen=True, slots=True)
class Curve:
    """A line through (x, y) `(n,)`, with points or a point at its start, and a label for the legend (empty: none).

    Widths and radii are in pixels of the SVG.
    """

    x: Floats
    y: Floats
    colour: str
    label: str = ""
    width: float = 1.5
    is_dashed: bool = False
    point_px: float = 0.0  # radius of the points
    has_start: bool = False


@dataclass(frozen=True, slots=True)
class ColourScale:
    """Colours of values from `low` to `high`, evenly divided, and a label with the unit of the values."""

    colours: Sequence[str]
    low: float
    high: float
    label: str

    @property
    def span(self) -> float:
        """The difference between the values of the first and the last colour."""
        return max(self.high - self.low, MIN_SCALE_SPAN)


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves in axes.

    is_plane: x and y have the same scale.
    from_zero: The y axis starts at zero.
    scale: The colours of the curves, drawn beside the axes.
    legend: The curves whose labels are in the legend.
    is_log: y are logarithms to base 10; the axis shows their powers.
    backdrop: Gives the colours `(n, 3)` of points `(n, 2)` behind the curves of a plane.
    within: Points `(k, 2)` that a plane shows in addition to the curves.
    notes: Texts at points (x, y).
    """

    curves: Sequence[Curve]
    x_label: str
    y_label: str
    title: str = ""
    is_plane: bool = False
    from_zero: bool = False
    scale: ColourScale | None = None
    legend: Sequence[Curve] = field(default_factory=tuple)
    is_log: bool = False
    backdrop: Callable[[Floats], Canvas] | None = None
    within: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    notes: Sequence[tuple[float, float, str]] = ()
