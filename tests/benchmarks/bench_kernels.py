"""The kernels of lidar mapping beside their slow reference implementations: how many times faster they are.

Those of localization, infrared, stereo and planning are in the other bench_kernels_*.py.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from gridslam.kernels import segments
from gridslam.kernels.grids import log_odds
from gridslam.kernels.scan_matching import (
    correlative_matching,
    scan_points,
    surfel_likelihood,
    surfel_registration,
    surfels,
)
from gridslam.maps.tiled import TileStore
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.kernel_pairs import Floats, Pair, rows_of_pairs
from tests.reference import correlative_matching as correlation_reference
from tests.reference import log_odds as log_odds_reference
from tests.reference import scan_points as scan_reference
from tests.reference import surfels as surfels_reference
from tests.reference.segment_casting import cast_one

ALONE = True

CELL_M = 0.2
HIT, MISS, LIMIT = 0.9, -0.4, 2.0
UPDATE = log_odds.LogOddsUpdate(HIT, MISS, LIMIT)


def rows() -> Iterator[BenchmarkRow]:
    """From a scan's ranges to its place in the maps, and the simulator's rays."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("scan_to_points", 1.5, scan_conversion(rng)),
            ("surface_normals", 200.0, normals_of_walls(rng)),
            ("insert_beams", 100.0, beam_insertion(rng)),
            ("insert_scan_dense", 150.0, dense_insertion(rng)),
            ("insert_surfels", 50.0, surface_insertion(rng)),
            ("log_likelihood", 1000.0, surface_likelihood(rng)),
            ("register", 250.0, registration(rng)),
            ("search_yaw", 200.0, yaw_search(rng)),
            ("field_pyramid", 0.5, field_levels(rng)),
            ("correlate", 100.0, correlative_search(rng)),
            ("cast_segments", 100.0, segment_casting(rng)),
        )
    )


def scan_conversion(rng: np.random.Generator) -> Pair:
    """A scan of 720 beams to points, against numpy."""
    ranges = rng.uniform(0.5, 20.0, 720).astype(np.float32)
    ranges[rng.random(720) < 0.1] = np.inf
    extrinsics = np.array([0.2, 0.1, 0.3])
    sweep, limits = scan_points.Sweep(-3.1, 0.0086, 0.0), scan_points.RangeLimits(0.05, 30.0)
    return (
        lambda: scan_points.scan_to_points(ranges, sweep, limits, extrinsics, np.zeros(3)),
        lambda: scan_reference.scan_to_points(ranges, *sweep[:2], *limits, extrinsics),
    )


def room(n: int) -> tuple[Floats, Floats]:
    """A scan of n beams in a room of 6 x 4 m: points and their normals."""
    bearings = np.linspace(-np.pi, np.pi, n, endpoint=False)
    beam = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    to_walls = np.array([3.0, 2.0]) / np.maximum(np.abs(beam), 1e-9)
    normals = -np.sign(beam) * (to_walls == to_walls.min(axis=1, keepdims=True))
    return beam * to_walls.min(axis=1)[:, None], normals


def normals_of_walls(rng: np.random.Generator) -> Pair:
    """Normals of a scan of 360 beams in a room."""
    points = room(360)[0] + rng.normal(0.0, 0.01, (360, 2))
    scan = (points, np.arange(360), np.zeros(2))
    return lambda: scan_points.surface_normals(*scan), lambda: scan_reference.surface_normals(*scan)


def around(rng: np.random.Generator, n: int, max_correspondence_m: float) -> Floats:
    """Points all around the origin."""
    angle, range_m = np.linspace(-np.pi, np.pi, n, endpoint=False), rng.uniform(1.0, max_correspondence_m, n)
    return np.stack([range_m * np.cos(angle), range_m * np.sin(angle)], axis=1)


def beam_insertion(rng: np.random.Generator) -> Pair:
    """A scan of 180 beams into a tiled map of 5 cm cells."""
    points, eye, pose = around(rng, 180, 8.0), np.array([0.013, 0.017]), np.zeros(3)
    store = TileStore(1, 1, 0.05)
    store.own_beams(np.array([0]), pose[None], eye, points)
    in_cells: list[tuple[float, float]] = [(x / 0.05, y / 0.05) for x, y in points.tolist()]

    def kernel() -> object:
        return log_odds.insert_beams(store.map(0), pose, log_odds.BeamBundle(eye, points), UPDATE)

    return kernel, lambda: log_odds_reference.insert({}, *(eye / 0.05), in_cells, HIT, MISS, LIMIT)


def dense_insertion(rng: np.random.Generator) -> Pair:
    """A scan of 180 beams into a grid of 400 x 400 cells, each changed once."""
    endpoints = around(rng, 180, 8.0) / 0.05 + 200.0
    values, last_update, hits = (
        np.full((400, 400), np.nan, np.float32),
        np.zeros((400, 400), np.uint8),
        np.ones(180, bool),
    )
    eye, in_cells = np.array([200.3, 200.4]), [(x, y) for x, y in endpoints.tolist()]
    numbers = itertools.cycle(range(1, 256))

    def kernel() -> object:
        beams = log_odds.BeamBundle(eye, endpoints)
        return log_odds.insert_scan_dense(values, last_update, next(numbers), beams, hits, UPDATE)

    return kernel, lambda: log_odds_reference.insert_once({}, *eye.tolist(), in_cells, HIT, MISS, LIMIT)


def surfaces(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Points all around, with random normals."""
    angle = rng.uniform(-np.pi, np.pi, n)
    return around(rng, n, 8.0), np.stack([np.cos(angle), np.sin(angle)], axis=1)


def surface_insertion(rng: np.random.Generator) -> Pair:
    """The 180 points of a scan into a surface map."""
    points, normals = surfaces(rng, 180)
    store = TileStore(1, surfels.CHANNELS, CELL_M)
    store.own_endpoints(np.array([0]), np.zeros((1, 3)), points)

    def kernel() -> object:
        return surfels.insert_surfels(store.map(0), np.zeros(3), surfels.OrientedPoints(points, normals))

    return kernel, lambda: surfels_reference.insert({}, points, normals, CELL_M)


def surface_likelihood(rng: np.random.Generator) -> Pair:
    """The likelihood of a scan of 180 points in a surface map of 2000."""
    surface, (points, normals) = surfaces(rng, 2000), surfaces(rng, 180)
    store, free = TileStore(1, surfels.CHANNELS, CELL_M), TileStore(1, 1, CELL_M)
    store.own_endpoints(np.array([0]), np.zeros((1, 3)), surface[0])
    surfels.insert_surfels(store.map(0), np.zeros(3), surfels.OrientedPoints(*surface))
    in_reference: surfels_reference.Surfaces = {}
    surfels_reference.insert(in_reference, *surface, CELL_M)
    scan, model = surfels.OrientedPoints(points, normals), surfel_likelihood.EndpointModel(0.06, 0.3, 0.1)

    def kernel() -> object:
        return surfel_likelihood.log_likelihood(
            store.map(0), free.map(0), np.zeros(2), scan, np.zeros(3), model
        )

    return kernel, lambda: surfels_reference.log_likelihood(in_reference, points, normals, 0.06, 0.3, 0.1)


def room_map() -> tuple[TileStore, surfels_reference.Surfaces]:
    """The surface map of the room, and the reference's."""
    surface, in_reference = room(1500), surfels_reference.Surfaces()
    store = TileStore(1, surfels.CHANNELS, CELL_M)
    store.own_endpoints(np.array([0]), np.zeros((1, 3)), surface[0])
    surfels.insert_surfels(store.map(0), np.zeros(3), surfels.OrientedPoints(*surface))
    surfels_reference.insert(in_reference, *surface, CELL_M)
    return store, in_reference


def registration(rng: np.random.Generator) -> Pair:
    """A scan of 180 points in the map of a room, 10 cm and 3 degrees off."""
    store, in_reference = room_map()
    scan, start, prior = room(180), rng.uniform(-0.1, 0.1, 3) * [1.0, 1.0, 0.5], np.diag([20.0, 20.0, 50.0])
    settings = surfel_registration.Registration(0.05, 0.4, 0.1, 6, 0.0)

    def kernel() -> object:
        pose_prior = surfel_registration.PosePrior(start, prior)
        points = surfels.OrientedPoints(*scan)
        return surfel_registration.register(store.map(0), points, start, pose_prior, settings)

    return kernel, lambda: surfels_reference.register(in_reference, *scan, start, prior, *settings[:4])


def yaw_search(rng: np.random.Generator) -> Pair:
    """The best of 13 headings of a scan of 180 points."""
    store, in_reference = room_map()
    scan, pose = room(180), np.array([0.02, -0.03, rng.uniform(-0.2, 0.2)])
    search = surfel_registration.YawSearch(0.05, 6, 1000, 0.1, 0.3)

    def kernel() -> object:
        return surfel_registration.search_yaw(store.map(0), surfels.OrientedPoints(*scan), pose, search)

    offsets = 0.05 * np.arange(-6, 7)
    return kernel, lambda: surfels_reference.yaw_scores(in_reference, *scan, pose, offsets, 0.1, 0.3)


def field_levels(rng: np.random.Generator) -> Pair:
    """Three levels of maxima over a field of 160 x 160 cells, against numpy."""
    field = rng.integers(0, 256, (160, 160)).astype(np.uint8)
    return (
        lambda: correlative_matching.field_pyramid(field, 3),
        lambda: [correlation_reference.field_level(field, level) for level in range(3)],
    )


def correlative_search(rng: np.random.Generator) -> Pair:
    """A search window of 1 x 1 m and +-6 degrees over a smooth field, by branch and bound against all poses."""
    margin, levels = 8, 3
    field = np.zeros((160, 160), np.uint8)
    walls = rng.integers(margin, 160 - margin, (400, 2))
    field[walls[:, 0], walls[:, 1]] = 255
    points = (walls[:60, ::-1] + 0.5) * 0.1 - 8.0
    pyramid, origin, start = (
        correlative_matching.field_pyramid(field, levels),
        np.array([-8.0, -8.0]),
        np.zeros(3),
    )

    def kernel() -> object:
        field_pyramid = correlative_matching.FieldPyramid(pyramid, origin, 0.1)
        window = correlative_matching.SearchWindow(0.5, 0.05, 2)
        return correlative_matching.correlate(field_pyramid, points, start, window, 0.0)

    return kernel, lambda: correlation_reference.correlate(field, origin, 0.1, points, start, 0.5, 0.05, 2)


def segment_casting(rng: np.random.Generator) -> Pair:
    """200 rays among 100 walls of the simulator."""
    walls = rng.uniform(-5.0, 5.0, (100, 4))
    grid = segments.BucketGrid(-5.1, -5.1, size=0.5, rows=21, cols=21)
    starts, items = segments.fill_buckets(walls, grid)
    angle = rng.uniform(-np.pi, np.pi, 200)
    rays = np.column_stack([rng.uniform(-4.0, 4.0, (200, 2)), np.cos(angle), np.sin(angle)])
    none, circles = np.zeros((0, 4)), np.zeros((0, 3))

    def kernel() -> object:
        return segments.cast_segments(
            segments=walls,
            starts=starts,
            items=items,
            grid=grid,
            moving=none,
            circles=circles,
            rays=rays,
            max_range=20.0,
        )

    return kernel, lambda: [cast_one(walls, circles, ray, 20.0) for ray in rays]
