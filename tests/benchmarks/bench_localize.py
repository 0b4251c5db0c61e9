"""Speed of the particle filter's steps with 10,000 particles, warm, against numpy on the same machine in the same run.

Milliseconds are for information; what is bounded is the factor over the numpy reference, which holds on a busy machine as well.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.filters.particles import Particles
from gridslam.filters.resampling import AdaptiveSize, resample
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.wean import load_wean_map
from gridslam.sensors.beam_model import BeamMixture, BeamModel
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import (
    DistanceField,
    distance_field,
    log_likelihood_table,
    occupied_cells,
)
from gridslam.sensors.range_caster import RangeCaster, range_caster
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.real_places import data_dir, place
from tests.methods.ispace_mcl.building import building
from tests.reference.ray_traversal import cast_cell_by_cell

ALONE = True

Floats = NDArray[np.float64]

PARTICLES = 10_000
BEAMS = 60
MAX_RANGE_M = 30.0
SIZE = AdaptiveSize(min=PARTICLES, max=PARTICLES, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.175)
MIXTURE = BeamMixture(
    sigma_m=0.2, hit=0.8, short=0.1, max=0.05, random=0.05, short_decay_per_m=0.2, bin_m=0.05
)


def rows() -> Iterator[BenchmarkRow]:
    """Weighting, resampling and ray casting on each map, with particles over the whole map and in one place."""
    for name, grid in maps():
        yield from rows_of(name, grid)
    yield from resampling_rows()


def maps() -> Iterator[tuple[str, OccupancyGrid]]:
    """Wean Hall (10 cm) and aces (5 cm); without the real logs a block of small buildings."""
    folder = data_dir()
    if folder is None:
        yield (
            "buildings",
            OccupancyGrid(np.tile(building().probability, (9, 8)), GridGeometry(0.1, (0.0, 0.0))),
        )
        return
    yield "wean", load_wean_map(folder / "wean_hall" / "wean.dat.gz")
    yield "aces", place(folder, "aces").grid


def rows_of(name: str, grid: OccupancyGrid) -> Iterator[BenchmarkRow]:
    """The rows of one map."""
    rng = np.random.default_rng(0)
    occupied = occupied_cells(grid, 0.65)
    field, caster = distance_field(occupied, grid.geometry, 2.0), range_caster(occupied, grid.geometry)
    table = log_likelihood_table(field, 0.15, 0.1)
    everywhere = draw_free_poses(free_cells(grid, 0.3), grid, PARTICLES, rng)
    together = everywhere[0] + rng.normal(0.0, (0.3, 0.3, 0.1), (PARTICLES, 3))
    beams = scan_from(caster, everywhere[0])
    model = BeamModel(caster, MIXTURE)
    for distribution, poses in (("everywhere", everywhere), ("together", together)):
        weigh = best_ms(lambda p=poses: field.table_sums(table, beams.points, p))
        reference = best_ms(lambda p=poses: numpy_sums(field, table, beams.points, p), 3)
        label = f"localize.{name}.{distribution}"
        yield BenchmarkRow(f"{label}.field", weigh, "ms")
        yield BenchmarkRow(f"{label}.field.over_numpy", reference / weigh, "x", 5.0, at_least=True)
        yield BenchmarkRow(f"{label}.beam", best_ms(lambda p=poses: model.log_likelihood(beams, p), 7), "ms")
    bearings = np.linspace(-np.pi, np.pi, 100, endpoint=False)
    cast = best_ms(lambda: caster.ranges(everywhere, bearings, np.zeros(3), MAX_RANGE_M), 5)
    per_s = 1e3 * PARTICLES * len(bearings) / cast
    yield BenchmarkRow(f"localize.{name}.rays", per_s / 1e6, "million/s")
    yield BenchmarkRow(
        f"localize.{name}.rays.over_python",
        per_s / python_rays_per_s(occupied, grid, everywhere),
        "x",
        100.0,
        True,
    )


def resampling_rows() -> Iterator[BenchmarkRow]:
    """KLD-adaptive systematic resampling."""
    rng = np.random.default_rng(1)
    poses = rng.normal(0.0, (0.3, 0.3, 0.1), (PARTICLES, 3))
    particles = Particles.even(poses).reweighted(rng.normal(0.0, 1.0, PARTICLES))
    ours = best_ms(lambda: resample(particles, SIZE, rng))
    reference = best_ms(lambda: numpy_resample(particles, rng))
    yield BenchmarkRow("localize.resampling", ours, "ms")
    yield BenchmarkRow("localize.resampling.over_numpy", reference / ours, "x", 2.0, at_least=True)


def best_ms(call: Callable[[], object], times: int = 15) -> float:
    """The shortest time of several calls after a first one, ms; other load on the machine affects it least."""
    call()
    taken = []
    for _ in range(times):
        started = time.perf_counter()
        call()
        taken.append(time.perf_counter() - started)
    return 1e3 * min(taken)


def scan_from(caster: RangeCaster, pose: Floats) -> Beams:
    """A scan of 60 beams all around from a pose."""
    bearings = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False)
    ranges = caster.ranges(pose[None], bearings, np.zeros(3), MAX_RANGE_M)[0].astype(np.float64)
    points = np.stack([np.cos(bearings), np.sin(bearings)], axis=1) * np.minimum(ranges, 8.0)[:, None]
    return Beams(
        ranges=ranges,
        bearings=bearings,
        returned=ranges < MAX_RANGE_M,
        points=points,
        extrinsics=np.zeros(3),
        max_range_m=MAX_RANGE_M,
        unreadable=0,
    )


def numpy_sums(field: DistanceField, table: NDArray[np.float32], points: Floats, poses: Floats) -> Floats:
    """The likelihood field model in numpy, for all particles at once."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    origin, step = field.geometry.origin_xy_m, field.geometry.resolution_m
    x = (poses[:, 0, None] - origin[0] + cos * points[:, 0] - sin * points[:, 1]) / step
    y = (poses[:, 1, None] - origin[1] + sin * points[:, 0] + cos * points[:, 1]) / step
    rows, cols = field.steps.shape
    col, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    inside = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
    steps = field.steps[np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)]
    return np.asarray(table[np.where(inside, steps, 255)].sum(axis=1, dtype=np.float64))


def numpy_resample(particles: Particles, rng: np.random.Generator) -> Floats:
    """Systematic resampling and counting of bins with numpy."""
    positions = (np.arange(PARTICLES) + rng.random()) / PARTICLES
    chosen = np.minimum(np.searchsorted(np.cumsum(particles.weights), positions), PARTICLES - 1)
    sampled = particles.poses[chosen]
    np.unique(np.floor(sampled / (SIZE.bin_m, SIZE.bin_m, SIZE.bin_rad)).astype(np.int64), axis=0)
    return sampled


def python_rays_per_s(occupied: NDArray[np.bool_], grid: OccupancyGrid, poses: Floats) -> float:
    """Rays a second of the reference implementation."""
    step, origin = grid.geometry.resolution_m, grid.geometry.origin_xy_m
    started = time.perf_counter()
    for x, y, yaw in poses[:200]:
        cast_cell_by_cell(occupied, (x - origin[0]) / step, (y - origin[1]) / step, yaw, MAX_RANGE_M / step)
    return 200 / (time.perf_counter() - started)
