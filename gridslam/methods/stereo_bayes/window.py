"""The values of a frame's rays in the cells around the robot, averaged over the pose's distribution (stereo-bayes 2.4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.stereo.polar_window import PolarWindow, averaged_over_yaw, window_of_rays

Floats = NDArray[np.float64]

SIGMAS = 3.0  # largest deviation of the pose that is averaged over, in standard deviations
MAX_YAW_STEPS = 64  # approximate largest number of yaw offsets
ANGLES_PER_RAY = 1.5  # number of angles per ray at which the mean over the yaw is evaluated
MIN_BLUR_CELLS = 0.3  # a smaller standard deviation has no effect
# Cells farther from every ray than this multiple of the gap between rays lie where bins have no evidence: no ray meets them
MAX_OFFSET_GAPS = 0.75
LONE_RAY_RAD = 0.005  # gap of a single ray
MARGIN_CELLS = 1
MIN_KERNEL_VARIANCE = 1e-3  # cells^2, keeps the covariance regular


@dataclass(frozen=True, slots=True)
class PolarValues:
    """c values of the n cells along each of m rays from one origin.

    `values` `(c, m, n)`; `default` `(c,)` of cells that no ray meets; `bearings` `(m,)` ascending, in the map's axes.
    """

    values: Floats
    default: Floats
    bearings: Floats

    @property
    def gap(self) -> float:
        """Angle between neighbouring rays, rad."""
        return float(np.median(np.diff(self.bearings))) if len(self.bearings) > 1 else LONE_RAY_RAD


@dataclass(frozen=True, slots=True)
class RayStart:
    """The start of the rays in the grid, in cells: their `origin` `(2,)` (x, y), and the range `first` at which they start."""

    origin: Floats
    first: float
    resolution_m: float


def window_radius(ray_start: RayStart, count: int, covariance: Floats) -> int:
    """The largest distance (cells) from the rays' origin to a cell that a frame with rays of `count` cells changes.

    `covariance` `(3, 3)` is that of the pose (m, rad).
    """
    blur = _blur_radius(covariance[:2, :2], ray_start.resolution_m)
    return int(np.ceil(ray_start.first + count)) + MARGIN_CELLS + blur


def window(polar: PolarValues, ray_start: RayStart, covariance: Floats) -> tuple[tuple[slice, slice], Floats]:
    """The rows and columns of the grid around the rays, and the values `(c, rows, cols)` of these cells.

    The values are averaged over the pose with its `covariance` `(3, 3)`: over the yaw in steps of one ray spacing, over the
    position by a Gaussian blur.
    """
    max_offset_rad = MAX_OFFSET_GAPS * polar.gap
    count = polar.values.shape[2]
    yaw_offsets, weights = _yaw_offsets(covariance, ray_start, polar)
    if len(yaw_offsets) > 1:
        polar, max_offset_rad = _averaged(polar, max_offset_rad, yaw_offsets, weights)
    blur = _blur_radius(covariance[:2, :2], ray_start.resolution_m)
    rows, cols = _bounds(polar, max_offset_rad, ray_start, count, blur)
    corner = np.array([cols.start, rows.start]) + 0.5 - ray_start.origin
    found = window_of_rays(
        PolarWindow(polar.values, polar.default, polar.bearings, max_offset_rad),
        ray_start.first,
        corner,
        rows.stop - rows.start,
        cols.stop - cols.start,
    )
    if blur:
        kernel = _blur_kernel(covariance[:2, :2] / ray_start.resolution_m**2, blur)
        found = np.stack([cv2.filter2D(part, -1, kernel, borderType=cv2.BORDER_REPLICATE) for part in found])
    return (rows, cols), found


def _yaw_offsets(covariance: Floats, ray_start: RayStart, polar: PolarValues) -> tuple[Floats, Floats]:
    """Yaw offsets `(k,)` (rad), one ray spacing apart unless there are too many, and their weights `(k,)`."""
    std = float(np.sqrt(max(covariance[2, 2], 0.0)))
    if std * (ray_start.first + polar.values.shape[2]) < MIN_BLUR_CELLS:
        return np.zeros(1), np.ones(1)
    step = max(polar.gap, 2.0 * SIGMAS * std / MAX_YAW_STEPS)
    count = int(np.ceil(SIGMAS * std / step))
    offsets = np.asarray(step * np.arange(-count, count + 1), dtype=np.float64)
    weights = np.exp(-0.5 * np.square(offsets / std))
    return offsets, np.asarray(weights / weights.sum())


def _averaged(
    polar: PolarValues, max_offset_rad: float, yaw_offsets: Floats, weights: Floats
) -> tuple[PolarValues, float]:
    """The mean over the yaw offsets, along more closely spaced rays, and the largest offset from them (rad)."""
    low = polar.bearings[0] + yaw_offsets.min() - max_offset_rad
    high = polar.bearings[-1] + yaw_offsets.max() + max_offset_rad
    high = min(high, low + 2.0 * np.pi)
    angles = np.linspace(low, high, max(int(np.ceil(ANGLES_PER_RAY * (high - low) / polar.gap)), 2))
    rays = PolarWindow(polar.values, polar.default, polar.bearings, max_offset_rad)
    mean = averaged_over_yaw(rays, yaw_offsets, weights, angles)
    return PolarValues(mean, polar.default, angles), MAX_OFFSET_GAPS * float(angles[1] - angles[0])


def _bounds(
    polar: PolarValues, max_offset_rad: float, ray_start: RayStart, count: int, blur: int
) -> tuple[slice, slice]:
    """The rows and columns of the sector of the rays, with a margin of `blur` + MARGIN_CELLS cells."""
    low, high = float(polar.bearings[0]) - max_offset_rad, float(polar.bearings[-1]) + max_offset_rad
    quarters = 0.5 * np.pi * np.arange(np.ceil(low / (0.5 * np.pi)), np.floor(high / (0.5 * np.pi)) + 1)
    angles = np.concatenate([[low, high], quarters])
    corners = (ray_start.first + count) * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = ray_start.origin + np.vstack([corners, np.zeros(2)])
    margin = MARGIN_CELLS + blur
    first = np.floor(corners.min(axis=0)).astype(int) - margin
    last = np.floor(corners.max(axis=0)).astype(int) + margin
    return slice(int(first[1]), int(last[1]) + 1), slice(int(first[0]), int(last[0]) + 1)


def _blur_radius(covariance: Floats, resolution_m: float) -> int:
    """Radius (cells) of a Gaussian with this covariance `(2, 2)` (m^2); 0 if it is too narrow to matter."""
    widest = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0))) / resolution_m
    return 0 if widest < MIN_BLUR_CELLS else int(np.ceil(SIGMAS * widest))


def _blur_kernel(covariance: Floats, radius: int) -> Floats:
    """Weights `(2 radius + 1, 2 radius + 1)` of a Gaussian with this covariance `(2, 2)` (cells^2)."""
    offsets = np.arange(-radius, radius + 1)
    x, y = np.meshgrid(offsets, offsets)
    inverse = np.linalg.inv(covariance + MIN_KERNEL_VARIANCE * np.eye(2))
    kernel = np.exp(-0.5 * (inverse[0, 0] * x * x + 2.0 * inverse[0, 1] * x * y + inverse[1, 1] * y * y))
    return np.asarray(kernel / kernel.sum())
