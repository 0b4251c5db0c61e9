"""What the rays of a frame say to the cells around the robot, averaged over where it may be (stereo-bayes 2.4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.polar_window import averaged_over_turns, window_of_rays

Floats = NDArray[np.float64]

_DEVIATIONS = 3.0  # of the pose that are averaged over
_MOST_TURNS = 64
_CLOSER = 1.5  # than the rays, what is averaged over the heading
_LEAST_BLUR = 0.3  # cells: less than this does nothing
_REACH_IN_GAPS = 0.75  # of neighbouring rays: cells farther from every ray are between bins that told nothing
_LONE_RAY_RAD = 0.005
_MARGIN = 1


@dataclass(frozen=True, slots=True)
class PolarValues:
    """c values of the n cells along each of m rays, all from one place.

    `values` `(c, m, n)`, `rest` `(c,)` what cells have that no ray meets, `bearings` `(m,)` ascending, in the map's axes.
    """

    values: Floats
    rest: Floats
    bearings: Floats

    @property
    def gap(self) -> float:
        """How far apart neighbouring rays are, rad."""
        return float(np.median(np.diff(self.bearings))) if len(self.bearings) > 1 else _LONE_RAY_RAD


@dataclass(frozen=True, slots=True)
class Lattice:
    """In cells: `eye` `(2,)` the rays' origin (x, y), `first` the range at which their cells begin."""

    eye: Floats
    first: float
    resolution_m: float


def reach_in_cells(lattice: Lattice, count: int, covariance: Floats) -> int:
    """How many cells from the eye's a frame touches at most."""
    return (
        int(np.ceil(lattice.first + count)) + _MARGIN + _blur_reach(covariance[:2, :2], lattice.resolution_m)
    )


def window(polar: PolarValues, lattice: Lattice, covariance: Floats) -> tuple[tuple[slice, slice], Floats]:
    """The part of the grid that the rays touch, and its cells' values `(c, rows, cols)`.

    The values are averaged over the pose's `covariance` `(3, 3)`: over the heading in steps of a ray,
    over the place by a Gaussian.
    """
    reach_rad = _REACH_IN_GAPS * polar.gap
    count = polar.values.shape[2]
    turns, weights = _turns(covariance, lattice, polar)
    if len(turns) > 1:
        polar, reach_rad = _turned(polar, reach_rad, turns, weights)
    rows, cols = _touched(polar, reach_rad, lattice, count, covariance)
    corner = np.array([cols.start, rows.start]) + 0.5 - lattice.eye
    found = window_of_rays(
        polar.values,
        polar.rest,
        polar.bearings,
        reach_rad,
        lattice.first,
        corner,
        rows.stop - rows.start,
        cols.stop - cols.start,
    )
    reach = _blur_reach(covariance[:2, :2], lattice.resolution_m)
    if reach:
        kernel = _blur_kernel(covariance[:2, :2] / lattice.resolution_m**2, reach)
        found = np.stack([cv2.filter2D(part, -1, kernel, borderType=cv2.BORDER_REPLICATE) for part in found])
    return (rows, cols), found


def _turns(covariance: Floats, lattice: Lattice, polar: PolarValues) -> tuple[Floats, Floats]:
    """Headings off the mean, as far apart as the rays are where that is not too many, and their weights."""
    deviation = float(np.sqrt(max(covariance[2, 2], 0.0)))
    if deviation * (lattice.first + polar.values.shape[2]) < _LEAST_BLUR:
        return np.zeros(1), np.ones(1)
    step = max(polar.gap, 2.0 * _DEVIATIONS * deviation / _MOST_TURNS)
    count = int(np.ceil(_DEVIATIONS * deviation / step))
    turns = np.asarray(step * np.arange(-count, count + 1), dtype=np.float64)
    weights = np.exp(-0.5 * np.square(turns / deviation))
    return turns, np.asarray(weights / weights.sum())


def _turned(
    polar: PolarValues, reach_rad: float, turns: Floats, weights: Floats
) -> tuple[PolarValues, float]:
    """The mean over the turns, at directions closer than the rays and as far as these may be turned."""
    low, high = polar.bearings[0] + turns.min() - reach_rad, polar.bearings[-1] + turns.max() + reach_rad
    high = min(high, low + 2.0 * np.pi)
    angles = np.linspace(low, high, max(int(np.ceil(_CLOSER * (high - low) / polar.gap)), 2))
    mean = averaged_over_turns(polar.values, polar.rest, polar.bearings, reach_rad, turns, weights, angles)
    return PolarValues(mean, polar.rest, angles), _REACH_IN_GAPS * float(angles[1] - angles[0])


def _touched(
    polar: PolarValues, reach_rad: float, lattice: Lattice, count: int, covariance: Floats
) -> tuple[slice, slice]:
    """The rows and columns of a sector, and a margin."""
    low, high = float(polar.bearings[0]) - reach_rad, float(polar.bearings[-1]) + reach_rad
    quarters = 0.5 * np.pi * np.arange(np.ceil(low / (0.5 * np.pi)), np.floor(high / (0.5 * np.pi)) + 1)
    angles = np.concatenate([[low, high], quarters])
    corners = (lattice.first + count) * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = lattice.eye + np.vstack([corners, np.zeros(2)])
    margin = _MARGIN + _blur_reach(covariance[:2, :2], lattice.resolution_m)
    first = np.floor(corners.min(axis=0)).astype(int) - margin
    last = np.floor(corners.max(axis=0)).astype(int) + margin
    return slice(int(first[1]), int(last[1]) + 1), slice(int(first[0]), int(last[0]) + 1)


def _blur_reach(covariance: Floats, resolution_m: float) -> int:
    """How many cells a Gaussian with this covariance `(2, 2)`, m^2, reaches; 0: too narrow to matter."""
    widest = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0))) / resolution_m
    return 0 if widest < _LEAST_BLUR else int(np.ceil(_DEVIATIONS * widest))


def _blur_kernel(in_cells: Floats, reach: int) -> Floats:
    """Weights `(2 reach + 1, 2 reach + 1)` of a Gaussian with this covariance."""
    offsets = np.arange(-reach, reach + 1)
    x, y = np.meshgrid(offsets, offsets)
    inverse = np.linalg.inv(in_cells + 1e-3 * np.eye(2))
    kernel = np.exp(-0.5 * (inverse[0, 0] * x * x + 2.0 * inverse[0, 1] * x * y + inverse[1, 1] * y * y))
    return np.asarray(kernel / kernel.sum())
