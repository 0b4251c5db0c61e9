"""Many growing grids that share their common tiles; tiles are allocated on demand and copied on write."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.kernels.grids import tiles as kernel

GROWTH_MARGIN_TILES = 4


class TileStore:
    """`n_maps` grids with `channels` float32 values per cell, zero where nothing has been written.

    The window that the directory covers grows with the written cells. Memory is bounded, so that one wrong pose cannot exhaust
    the machine: MethodError if the tiles and the directory would exceed `memory_limit_mb`.
    """

    def __init__(
        self, n_maps: int, channels: int, resolution_m: float, memory_limit_mb: float = 1024.0
    ) -> None:
        self.resolution_m = resolution_m
        self.memory_limit_mb = memory_limit_mb
        self.origin = np.zeros(2, np.int64)  # tile (row, col) of directory[:, 0, 0]
        self._corner = 0, 0  # the same as plain numbers
        self.directory = np.full((n_maps, 1, 1), -1, np.int32)
        self.pool = np.zeros((0, kernel.TILE_CELLS, kernel.TILE_CELLS, channels), np.float32)
        self.refcount = np.zeros(0, np.int32)
        self.free = np.zeros(0, np.int32)
        self.n_free = 0
        self._wanted = np.zeros((1, 1), np.bool_)

    @property
    def memory_mb(self) -> float:
        """Memory of the tiles and the directory, 10^6 bytes."""
        return (self.pool.nbytes + self.directory.nbytes) / 1e6

    @property
    def tiles_in_use(self) -> int:
        """Tiles that at least one map holds."""
        return len(self.refcount) - self.n_free

    @property
    def maps(self) -> kernel.TileMaps:
        """All maps as the kernels take them; valid until the next call that makes tiles writable."""
        return kernel.TileMaps(self.directory, self.pool, self.origin, self.resolution_m)

    def map(self, index: int) -> kernel.TileMap:
        """One map as the kernels take it; valid until the next call that makes tiles writable."""
        return kernel.TileMap(self.directory[index], self.pool, self.origin, self.resolution_m)

    def own_endpoints(
        self, maps: NDArray[np.int64], poses: NDArray[np.float64], points: NDArray[np.float64]
    ) -> None:
        """Make the tiles that contain the points `(m, 2)`, seen from pose k `(n, 3)`, writable in map maps[k]."""
        self._own_tiles_of_scan(maps, poses, np.zeros(2), points, with_beams=False)

    def own_beams(
        self,
        maps: NDArray[np.int64],
        poses: NDArray[np.float64],
        viewpoint: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> None:
        """Make all tiles writable that the beams from the viewpoint (2,) (robot's frame) to the points `(m, 2)` cross."""
        self._own_tiles_of_scan(maps, poses, viewpoint, points, with_beams=True)

    def own_scans(
        self,
        map_index: int,
        poses: NDArray[np.float64],
        viewpoint: NDArray[np.float64],
        scans: kernel.ScanSet,
        with_beams: bool,
    ) -> None:
        """Make the tiles of many scans, seen from `poses` `(s, 3)`, writable in one map.

        These are the tiles of the endpoints; with beams, also those that the beams from the viewpoint (2,) cross.
        """
        radius_m = max(kernel.radius_of(scans.points), float(np.hypot(viewpoint[0], viewpoint[1])))
        self._cover(poses, radius_m)
        kernel.mark_tiles_of_scans(
            self._wanted,
            self.map(map_index),
            poses=poses,
            viewpoint=viewpoint,
            scans=scans,
            with_beams=with_beams,
        )
        self._own(map_index)

    def redistribute(self, ancestors: NDArray[np.int64]) -> None:
        """Resampling: map i becomes a copy of map ancestors[i]; `ancestors` `(maps,)`."""
        self.n_free = kernel.redistribute(self.directory, ancestors, self._tile_pool, self.n_free)

    def clear(self, map_index: int) -> None:
        """Empty one map."""
        held = self.directory[map_index][self.directory[map_index] >= 0]
        self.refcount[held] -= 1
        released = held[self.refcount[held] == 0]
        self.free[self.n_free : self.n_free + len(released)] = released
        self.n_free += len(released)
        self.directory[map_index] = -1

    def dense(self, map_index: int) -> tuple[NDArray[np.float32], tuple[int, int]]:
        """One map as an array (rows, cols, channels), and the cell (row, col) of its lower-left corner."""
        held = np.argwhere(self.directory[map_index] >= 0)
        size = kernel.TILE_CELLS
        if not len(held):
            return np.zeros((0, 0, self.pool.shape[3]), np.float32), (0, 0)
        lo, hi = held.min(axis=0), held.max(axis=0) + 1
        rows, cols = (hi - lo) * size
        out = np.zeros((rows, cols, self.pool.shape[3]), np.float32)
        for row, col in held:
            r, c = (row - lo[0]) * size, (col - lo[1]) * size
            out[r : r + size, c : c + size] = self.pool[self.directory[map_index, row, col]]
        corner = (self.origin + lo) * size
        return out, (int(corner[0]), int(corner[1]))

    @property
    def _tile_pool(self) -> kernel.TilePool:
        return kernel.TilePool(self.pool, self.refcount, self.free)

    def _own(self, map_index: int) -> None:
        needed = int(np.count_nonzero(self._wanted))
        if needed > self.n_free:
            self._grow_pool(needed - self.n_free)
        self.n_free = kernel.own_tiles(self._wanted, self.directory[map_index], self._tile_pool, self.n_free)

    def _own_tiles_of_scan(
        self,
        maps: NDArray[np.int64],
        poses: NDArray[np.float64],
        viewpoint: NDArray[np.float64],
        points: NDArray[np.float64],
        with_beams: bool,
    ) -> None:
        radius_m = max(kernel.radius_of(points), float(np.hypot(viewpoint[0], viewpoint[1])))
        self._cover(poses, radius_m)
        scan = kernel.ScanInMaps(
            maps, poses, viewpoint=viewpoint, points=points, radius_m=radius_m, with_beams=with_beams
        )
        done = 0
        while done < len(maps):
            self.n_free, done, needed = kernel.own_tiles_of_scan(
                self._wanted, self.maps, pool=self._tile_pool, n_free=self.n_free, scan=scan, first=done
            )
            if done < len(maps):
                self._grow_pool(needed - self.n_free)

    def _cover(self, poses: NDArray[np.float64], radius_m: float) -> None:
        """Extend the directory's window to everything within a radius of the poses `(n, 3)`."""
        if not len(poses):
            return
        bounds = kernel.bounds_of(poses, radius_m)
        if not math.isfinite(sum(bounds)):
            raise MethodError("a pose or a scan point is not finite: it cannot be drawn into the map")
        tile_m = self.resolution_m * kernel.TILE_CELLS
        lo_row, lo_col, hi_row, hi_col = (math.floor(b / tile_m) for b in bounds)
        rows, cols = self.directory.shape[1:]
        row, col = self._corner
        if row <= lo_row and col <= lo_col and hi_row < row + rows and hi_col < col + cols:
            return
        lo, hi = np.array([lo_row, lo_col]), np.array([hi_row + 1, hi_col + 1])
        end = self.origin + np.array([rows, cols])
        first = not (self.directory >= 0).any()
        new_lo = (lo if first else np.minimum(lo, self.origin)) - GROWTH_MARGIN_TILES
        new_hi = (hi if first else np.maximum(hi, end)) + GROWTH_MARGIN_TILES
        n_maps = len(self.directory)
        size = new_hi - new_lo
        self._check_memory(self.pool.nbytes + 4.0 * n_maps * float(size[0]) * float(size[1]))
        grown = np.full((n_maps, size[0], size[1]), -1, np.int32)
        if not first:
            r, c = self.origin - new_lo
            grown[:, r : r + rows, c : c + cols] = self.directory
        self.directory, self.origin = grown, new_lo
        self._corner = int(new_lo[0]), int(new_lo[1])
        self._wanted = np.zeros((size[0], size[1]), np.bool_)

    def _grow_pool(self, missing: int) -> None:
        n = len(self.refcount)
        tile_bytes = 4 * kernel.TILE_CELLS**2 * self.pool.shape[3]
        grown = n + max(missing, n // 4, 64)
        self._check_memory(float(grown) * tile_bytes + self.directory.nbytes)
        self.pool = np.concatenate([self.pool, np.zeros((grown - n, *self.pool.shape[1:]), np.float32)])
        self.refcount = np.concatenate([self.refcount, np.zeros(grown - n, np.int32)])
        free = np.empty(grown, np.int32)
        free[: self.n_free] = self.free[: self.n_free]
        free[self.n_free : self.n_free + grown - n] = np.arange(grown - 1, n - 1, -1)
        self.free = free
        self.n_free += grown - n

    def _check_memory(self, wanted_bytes: float) -> None:
        if wanted_bytes > self.memory_limit_mb * 1e6:
            raise MethodError(
                f"the map would need {wanted_bytes / 1e6:.0f} MB, more than memory_limit_mb = {self.memory_limit_mb:g}: "
                "the trajectory is wrong, or raise the limit, use fewer particles or coarsen the cells"
            )
