"""Likelihood of a scan's endpoints, given a map of surface elements and the log-odds of the space in front of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.tiles import TILE_BITS, TILE_MASK, TileMap, TileMaps, map_of
from gridslam.kernels.scan_matching.surfels import NX, NY, OrientedPoints, X, Y, nearest_surfel
from gridslam.kernels.threads import run_in_ranges

SURELY_OCCUPIED = 1.5  # log-odds above which no beam should have passed a cell


class EndpointModel(NamedTuple):
    """Standard deviation of an endpoint about a surface, farthest correspondence, ratio of readings that no surface explains."""

    sigma_m: float
    max_correspondence_m: float
    random_ratio: float


@compiled
def _log_odds_at(tile_map: TileMap, row: int, col: int) -> float:
    """Log-odds of one cell of one map, 0 where nothing has been written."""
    directory, origin = tile_map.directory, tile_map.origin
    t_row, t_col = (row >> TILE_BITS) - origin[0], (col >> TILE_BITS) - origin[1]
    if t_row < 0 or t_row >= directory.shape[0] or t_col < 0 or t_col >= directory.shape[1]:
        return 0.0
    tile = directory[t_row, t_col]
    return float(tile_map.pool[tile, row & TILE_MASK, col & TILE_MASK, 0]) if tile >= 0 else 0.0


@compiled
def _crosses_wall(cells: TileMap, x0: float, y0: float, x1: float, y1: float, margin_m: float) -> bool:
    """Whether the segment from (x0, y0) to `margin_m` before (x1, y1) crosses a cell that is surely occupied."""
    length = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    steps = int((length - margin_m) / cells.resolution_m)
    for k in range(1, steps + 1):
        t = k * cells.resolution_m / length
        row = int(np.floor((y0 + t * (y1 - y0)) / cells.resolution_m))
        col = int(np.floor((x0 + t * (x1 - x0)) / cells.resolution_m))
        if _log_odds_at(cells, row, col) > SURELY_OCCUPIED:
            return True
    return False


@compiled
def log_likelihood(
    surfaces: TileMap,
    cells: TileMap,
    viewpoint: NDArray[np.float64],
    scan: OrientedPoints,
    pose: NDArray[np.float64],
    model: EndpointModel,
) -> float:
    """Log likelihood of a scan seen from `pose` (3,), given the surfaces and the log-odds `cells` of one map.

    `viewpoint` (2,) is the lidar in the robot's frame, `model` the noise of an endpoint.
    An endpoint at distance e from a surface counts log((1 - random_ratio) exp(-e^2 / (2 sigma^2)) + random_ratio). An
    endpoint without a surface counts as e = inf where the map knows free space or has a wall in front of it. On unknown
    ground it counts as e = sigma, so that new ground speaks neither for nor against a pose.
    """
    points, normals = scan.points, scan.normals
    sigma_m, random_ratio = model.sigma_m, model.random_ratio
    total = 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    miss = np.log(random_ratio)
    neutral = np.log((1.0 - random_ratio) * np.exp(-0.5) + random_ratio)
    x0 = pose[0] + c * viewpoint[0] - s * viewpoint[1]
    y0 = pose[1] + s * viewpoint[0] + c * viewpoint[1]
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        nx = c * normals[i, 0] - s * normals[i, 1]
        ny = s * normals[i, 0] + c * normals[i, 1]
        tile, row, col = nearest_surfel(
            surfaces, x, y, nx=nx, ny=ny, max_distance_m=model.max_correspondence_m
        )
        if tile >= 0:
            cell = surfaces.pool[tile, row, col]
            scale = 1.0 / np.sqrt(cell[NX] * cell[NX] + cell[NY] * cell[NY])
            e = scale * (cell[NX] * (x - cell[X]) + cell[NY] * (y - cell[Y]))
            total += np.log((1.0 - random_ratio) * np.exp(-0.5 * (e / sigma_m) ** 2) + random_ratio)
            continue
        row, col = int(np.floor(y / cells.resolution_m)), int(np.floor(x / cells.resolution_m))
        if _log_odds_at(cells, row, col) < 0.0 or _crosses_wall(
            cells, x0, y0, x1=x, y1=y, margin_m=model.max_correspondence_m
        ):
            total += miss
        else:
            total += neutral
    return total


def log_likelihood_all(
    surfaces: TileMaps,
    cells: TileMaps,
    viewpoint: NDArray[np.float64],
    scan: OrientedPoints,
    poses: NDArray[np.float64],
    model: EndpointModel,
) -> NDArray[np.float64]:
    """`log_likelihood` `(n,)` of a `scan` for every particle, at its pose `(n, 3)` in its own map.

    `surfaces`, `cells`, `viewpoint` (2,) and `model` as there.
    """
    n = poses.shape[0]
    out = np.empty(n)
    run_in_ranges(_log_likelihood_all, n, (surfaces, cells, viewpoint, scan, poses, model, out))
    return out


@compiled
def _log_likelihood_all(
    first: int,
    last: int,
    surfaces: TileMaps,
    cells: TileMaps,
    viewpoint: NDArray[np.float64],
    scan: OrientedPoints,
    poses: NDArray[np.float64],
    model: EndpointModel,
    out: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `log_likelihood_all`."""
    for k in range(first, last):
        out[k] = log_likelihood(
            map_of(surfaces, k), map_of(cells, k), viewpoint, scan=scan, pose=poses[k], model=model
        )
