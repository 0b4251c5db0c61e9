"""Many prepared scans in half the memory: single precision, in few large blocks."""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]

BLOCK_VALUES = 1 << 18  # of four bytes


class _Place(NamedTuple):
    """Where a scan is kept: its block, the first of its values there, and what is not in the block."""

    block: int
    start: int
    sizes: tuple[int, int, int]  # numbers of returns, points and surface points
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
        parts = (scan.returns, scan.points, scan.normals, scan.surface, scan.surface_normals)
        size = sum(part.size for part in parts)
        if not self._blocks or self._used + size > len(self._blocks[-1]):
            self._blocks.append(_new_block(max(BLOCK_VALUES, size)))
            self._used = 0
        sizes = len(scan.returns), len(scan.points), len(scan.surface)
        self._places.append(_Place(len(self._blocks) - 1, self._used, sizes, scan.stamp_ns, scan.viewpoint))
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
        returns, points, surface = place.sizes
        arrays = []
        for count in (returns, points, points, surface, surface):
            arrays.append(block[at : at + 2 * count].reshape(-1, 2).astype(np.float64))
            at += 2 * count
        return PreparedScan(place.stamp_ns, place.viewpoint, *arrays)


def _new_block(values: int) -> NDArray[np.float32]:
    """Memory straight from the system, which gets it back as soon as the scans are not needed; an allocator may keep it."""
    return np.frombuffer(mmap.mmap(-1, values * np.dtype(np.float32).itemsize), np.float32)
