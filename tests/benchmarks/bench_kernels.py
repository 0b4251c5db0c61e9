"""Every mapping kernel beside its slow twin on the same input, warm, in one process: how many times faster it is.

The localization kernels have the same in bench_localize.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import correlation, log_odds, scan_points, segments, surfel_likelihood, surfels
from gridslam.maps.tiled import TileStore
from tests.benchmarks.bench_localize import best_ms
from tests.benchmarks.harness import Row
from tests.reference import correlation as correlation_twin
from tests.reference import log_odds as log_odds_twin
from tests.reference import surfels as surfels_twin
from tests.reference.segment_casting import cast_one

ALONE = True

Floats = NDArray[np.float64]
Call = Callable[[], object]

CELL_M = 0.2
HIT, MISS, LIMIT = 0.9, -0.4, 2.0


def rows() -> Iterator[Row]:
    """Milliseconds of a call for information, the factor with its bound."""
    rng = np.random.default_rng(0)
    for name, at_least, (kernel, twin) in (
        ("scan_to_points", 1.5, scan_conversion(rng)),
        ("insert_beams", 100.0, beam_insertion(rng)),
        ("insert_surfels", 50.0, surface_insertion(rng)),
        ("log_likelihood", 1000.0, surface_likelihood(rng)),
        ("correlate", 100.0, correlative_search(rng)),
        ("cast_segments", 100.0, segment_casting(rng)),
    ):
        ours = best_ms(kernel)
        yield Row(f"kernels.{name}", ours, "ms")
        yield Row(f"kernels.{name}.over_twin", best_ms(twin, 2) / ours, "x", at_least, at_least=True)


def scan_conversion(rng: np.random.Generator) -> tuple[Call, Call]:
    """A scan of 720 beams to points, against numpy."""
    ranges = rng.uniform(0.5, 20.0, 720).astype(np.float32)
    ranges[rng.random(720) < 0.1] = np.inf
    mounting = np.array([0.2, 0.1, 0.3])

    def numpy_twin() -> Floats:
        keep = np.flatnonzero((ranges > 0.05) & (ranges < 30.0))
        angles, r = -3.1 + 0.0086 * keep, ranges[keep].astype(np.float64)
        cos, sin = np.cos(mounting[2]), np.sin(mounting[2])
        x, y = r * np.cos(angles), r * np.sin(angles)
        return np.stack([mounting[0] + cos * x - sin * y, mounting[1] + sin * x + cos * y], axis=1)

    def kernel() -> object:
        return scan_points.scan_to_points(ranges, -3.1, 0.0086, 0.05, 30.0, mounting, np.zeros(3), 0.0)

    return kernel, numpy_twin


def around(rng: np.random.Generator, n: int, reach_m: float) -> Floats:
    """Points all around the origin."""
    angle, range_m = np.linspace(-np.pi, np.pi, n, endpoint=False), rng.uniform(1.0, reach_m, n)
    return np.stack([range_m * np.cos(angle), range_m * np.sin(angle)], axis=1)


def beam_insertion(rng: np.random.Generator) -> tuple[Call, Call]:
    """A scan of 180 beams into a tiled map of 5 cm cells."""
    points, eye, pose = around(rng, 180, 8.0), np.array([0.013, 0.017]), np.zeros(3)
    store = TileStore(1, 1, 0.05)
    store.own_beams(np.array([0]), pose[None], eye, points)
    in_cells: list[tuple[float, float]] = [(x / 0.05, y / 0.05) for x, y in points.tolist()]

    def kernel() -> object:
        return log_odds.insert_beams(
            store.directory[0], store.pool, store.origin, 0.05, pose, eye, points, HIT, MISS, LIMIT
        )

    return kernel, lambda: log_odds_twin.insert({}, *(eye / 0.05), in_cells, HIT, MISS, LIMIT)


def surfaces(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Points all around, with random normals."""
    angle = rng.uniform(-np.pi, np.pi, n)
    return around(rng, n, 8.0), np.stack([np.cos(angle), np.sin(angle)], axis=1)


def surface_insertion(rng: np.random.Generator) -> tuple[Call, Call]:
    """The 180 points of a scan into a surface map."""
    points, normals = surfaces(rng, 180)
    store = TileStore(1, surfels.CHANNELS, CELL_M)
    store.own_end_points(np.array([0]), np.zeros((1, 3)), points)

    def kernel() -> object:
        return surfels.insert_surfels(
            store.directory[0], store.pool, store.origin, CELL_M, np.zeros(3), points, normals
        )

    return kernel, lambda: surfels_twin.insert({}, points, normals, CELL_M)


def surface_likelihood(rng: np.random.Generator) -> tuple[Call, Call]:
    """The likelihood of a scan of 180 points in a surface map of 2000."""
    surface, (points, normals) = surfaces(rng, 2000), surfaces(rng, 180)
    store, free = TileStore(1, surfels.CHANNELS, CELL_M), TileStore(1, 1, CELL_M)
    store.own_end_points(np.array([0]), np.zeros((1, 3)), surface[0])
    surfels.insert_surfels(store.directory[0], store.pool, store.origin, CELL_M, np.zeros(3), *surface)
    in_twin: surfels_twin.Surfaces = {}
    surfels_twin.insert(in_twin, *surface, CELL_M)
    of_maps = (store.directory[0], store.pool, store.origin, CELL_M)
    of_free = (free.directory[0], free.pool, free.origin, CELL_M)

    def kernel() -> object:
        return surfel_likelihood.log_likelihood(
            *of_maps, np.zeros(2), points, normals, np.zeros(3), 0.06, 0.3, 0.1, *of_free
        )

    return kernel, lambda: surfels_twin.log_likelihood(in_twin, points, normals, 0.06, 0.3, 0.1)


def correlative_search(rng: np.random.Generator) -> tuple[Call, Call]:
    """A search window of 1 x 1 m and +-6 degrees over a smooth field, by branch and bound against all poses."""
    margin, levels = 8, 3
    field = np.zeros((160, 160), np.uint8)
    walls = rng.integers(margin, 160 - margin, (400, 2))
    field[walls[:, 0], walls[:, 1]] = 255
    points = (walls[:60, ::-1] + 0.5) * 0.1 - 8.0
    pyramid, origin, start = correlation.field_pyramid(field, levels), np.array([-8.0, -8.0]), np.zeros(3)

    def kernel() -> object:
        return correlation.correlate(pyramid, origin, 0.1, points, start, 0.5, 0.05, 2, 0.0)

    return kernel, lambda: correlation_twin.correlate(field, origin, 0.1, points, start, 0.5, 0.05, 2)


def segment_casting(rng: np.random.Generator) -> tuple[Call, Call]:
    """200 rays among 100 walls of the simulator."""
    walls = rng.uniform(-5.0, 5.0, (100, 4))
    grid = (-5.1, -5.1, 0.5, 21, 21)
    buckets = segments.fill_buckets(walls, *grid)
    angle = rng.uniform(-np.pi, np.pi, 200)
    rays = np.column_stack([rng.uniform(-4.0, 4.0, (200, 2)), np.cos(angle), np.sin(angle)])
    none, circles = np.zeros((0, 4)), np.zeros((0, 3))

    def kernel() -> object:
        return segments.cast_segments(walls, *buckets, grid, none, circles, rays, 20.0)

    return kernel, lambda: [cast_one(walls, circles, ray, 20.0) for ray in rays]
