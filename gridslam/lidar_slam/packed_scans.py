"""Many prepared scans in half the memory: single precision, in few large blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from gridslam.core.memory import system_zeros
from gridslam.kernels.row_subsets import rows_in_order
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]

BLOCK_VALUES = 1 << 18  # number of values of four bytes in a block


class _Place(NamedTuple):
    """Place of a packed scan: its block, the index of its first value there, and the parts that are not in the block."""

    block: int
    start: int
    sizes: tuple[int, int, int]  # numbers of returns, points and surface points
    rows: NDArray[np.uint16] | None  # of the surface that are the points; None: the points are kept beside it
    stamp_ns: int
    viewpoint: Floats


class PackedScans(Sequence[PreparedScan]):
    """Scans in the order in which they were appended. Coordinates are kept to 7 digits: 0.01 mm at 80 m."""

    def __init__(self) -> None:
        self._blocks: list[NDArray[np.float32]] = []
        self._used = 0  # values of the last block
        self._places: list[_Place] = []

    def append(self, scan: PreparedScan) -> None:
        """Keep a scan."""
        rows = _rows_of_points(scan)
        parts = [scan.returns, scan.surface, scan.surface_normals]
        if rows is None:
            parts += [scan.points, scan.normals]
        size = sum(part.size for part in parts)
        if not self._blocks or self._used + size > len(self._blocks[-1]):
            self._blocks.append(system_zeros(max(BLOCK_VALUES, size), np.float32))
            self._used = 0
        sizes = len(scan.returns), len(scan.points), len(scan.surface)
        self._places.append(
            _Place(
                block=len(self._blocks) - 1,
                start=self._used,
                sizes=sizes,
                rows=rows,
                stamp_ns=scan.stamp_ns,
                viewpoint=scan.viewpoint,
            )
        )
        for part in parts:
            self._blocks[-1][self._used : self._used + part.size] = part.ravel()
            self._used += part.size

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> PreparedScan: ...

    @overload
    def __getitem__(self, index: slice) -> list[PreparedScan]: ...

    def __getitem__(self, index: int | slice) -> PreparedScan | list[PreparedScan]:
        if isinstance(index, slice):
            return [self._unpacked(place) for place in self._places[index]]
        return self._unpacked(self._places[index])

    def __iter__(self) -> Iterator[PreparedScan]:
        return map(self._unpacked, self._places)

    def _unpacked(self, place: _Place) -> PreparedScan:
        block, at = self._blocks[place.block], place.start

        def taken(count: int) -> Floats:
            nonlocal at
            at += 2 * count
            return block[at - 2 * count : at].reshape(-1, 2).astype(np.float64)

        count_returns, count_points, count_surface = place.sizes
        returns, surface, surface_normals = taken(count_returns), taken(count_surface), taken(count_surface)
        if place.rows is None:
            points, normals = taken(count_points), taken(count_points)
        else:
            points, normals = surface[place.rows], surface_normals[place.rows]
        return PreparedScan(
            stamp_ns=place.stamp_ns,
            viewpoint=place.viewpoint,
            returns=returns,
            points=points,
            normals=normals,
            surface=surface,
            surface_normals=surface_normals,
        )


def _rows_of_points(scan: PreparedScan) -> NDArray[np.uint16] | None:
    """The rows of a scan's surface that are its points, with their normals; None if a point is not in the surface.

    In scans prepared from one sweep all points are: the surface is the points with the gaps between them filled.
    """
    if len(scan.surface) > np.iinfo(np.uint16).max:
        return None
    rows = rows_in_order(scan.points, scan.surface)
    if len(rows) < len(scan.points) or not np.array_equal(scan.surface_normals[rows], scan.normals):
        return None
    return np.asarray(rows, np.uint16)
