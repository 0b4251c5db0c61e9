"""The kernels of ir-scan beside their reference implementations: grids, matching, wall lines, wheels and gyro."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import wheel_gyro
from gridslam.kernels.infrared import infrared_beams, wall_lines
from gridslam.methods.ir_scan.lines import moments_of
from gridslam.methods.ir_scan.wall_equations import by_cell
from gridslam.motion.wheel_gyro import WheelGyroNoise
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.kernel_pairs import Floats, Pair, rows_of_pairs
from tests.reference import infrared as reference
from tests.reference import wall_lines as lines_reference
from tests.reference import wheel_gyro as wheels_reference

ALONE = True

READINGS, CELLS, MAX_SHIFT = 180, 400, 10  # of a stop; of a map 4 m wide; of the matching, in cells
CRITERIA = wall_lines.WallCriteria(min_points=4.0, max_thickness_m=0.05, map_variance=1e-5, robust_sigmas=2.5)


def rows() -> Iterator[BenchmarkRow]:
    """The kernels of one stop."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("add_readings", 150.0, drawing(rng)),
            ("count_crossed", 150.0, crossing(rng)),
            ("splat_maximum", 30.0, splats(rng)),
            ("shifted_sums", 600.0, shifting(rng)),
            ("shifted_changes", 600.0, changing(rng)),
            ("pooled_sums", 30.0, pooling(rng)),
            ("equations_on_lines", 400.0, pose_on_lines(rng)),
            ("equations_of_walls", 90.0, stops_and_walls(rng)),
            ("wheel_gyro", 40.0, wheels(rng)),
        )
    )


def endpoints_in_cells(rng: np.random.Generator) -> NDArray[np.int64]:
    """The cells (row, col) of the end points of a stop in the middle of the map."""
    bearings, ranges = np.linspace(-np.pi, np.pi, READINGS), rng.uniform(20.0, 150.0, READINGS)
    endpoints = np.stack([ranges * np.sin(bearings), ranges * np.cos(bearings)], axis=1) + 0.5 * CELLS
    return endpoints.astype(np.int64)


def drawing(rng: np.random.Generator) -> Pair:
    """Drawing the readings of a stop."""
    endpoints, bel = endpoints_in_cells(rng), np.full(READINGS, 0.5)
    origins, pos = np.full((READINGS, 2), CELLS // 2), np.zeros((CELLS, CELLS))
    readings = [((a, b), (c, d)) for (a, b), (c, d) in zip(origins.tolist(), endpoints.tolist(), strict=True)]
    return (
        lambda: infrared_beams.add_readings(pos, origins, endpoints, bel),
        lambda: [reference.add_reading(pos, *reading, 0.5) for reading in readings],
    )


def crossing(rng: np.random.Generator) -> Pair:
    """The cells that the readings of a stop pass."""
    endpoints, crossed = endpoints_in_cells(rng)[:, ::-1] + 0.37, np.zeros((CELLS, CELLS))
    origins = np.full((READINGS, 2), 0.5 * CELLS + 0.41)
    return (
        lambda: infrared_beams.count_crossed(crossed, origins, endpoints),
        lambda: reference.count_crossed(crossed, origins, endpoints),
    )


def splats(rng: np.random.Generator) -> Pair:
    """A splat of 9 x 9 cells around each reading, against numpy."""
    values, splat = np.zeros((CELLS, CELLS)), rng.random((9, 9))
    cells, weights = endpoints_in_cells(rng), rng.random(READINGS)
    return (
        lambda: infrared_beams.splat_maximum(values, cells, splat, weights),
        lambda: reference.splat_maximum(values, cells, splat, weights),
    )


def shifting(rng: np.random.Generator) -> Pair:
    """The sums under the readings at 21 x 21 shifts."""
    values, cells = rng.standard_normal((CELLS, CELLS)), endpoints_in_cells(rng)
    return (
        lambda: infrared_beams.shifted_sums(values, cells, MAX_SHIFT),
        lambda: reference.shifted_sums(values, cells, MAX_SHIFT),
    )


def changing(rng: np.random.Generator) -> Pair:
    """The changes of these sums from one shift to the others."""
    values, cells = rng.standard_normal((CELLS, CELLS)), endpoints_in_cells(rng)
    return (
        lambda: infrared_beams.shifted_changes(values, cells, MAX_SHIFT, -2, 3),
        lambda: reference.shifted_changes(values, cells, MAX_SHIFT, -2, 3),
    )


def pooling(rng: np.random.Generator) -> Pair:
    """The sums of 5 x 5 cells about each reading, against numpy."""
    values, cells = rng.standard_normal((CELLS, CELLS, 7)), endpoints_in_cells(rng)
    return (
        lambda: wall_lines.pooled_sums(values, cells, 2),
        lambda: lines_reference.pooled_sums(values, cells, 2),
    )


def on_walls(rng: np.random.Generator, n: int) -> Floats:
    """Points near two walls."""
    along, offset = rng.uniform(0.0, 2.0, n), rng.normal(0.0, 0.01, n)
    one, other = np.stack([along, 0.7 + offset], axis=1), np.stack([1.1 + offset, along], axis=1)
    return np.where(rng.random(n)[:, None] < 0.5, one, other)


def beams_to(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Directions of n beams, and the variances of their end points along and across."""
    angles = rng.uniform(-np.pi, np.pi, n)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1), rng.uniform(1e-5, 1e-3, (n, 2))


def pose_on_lines(rng: np.random.Generator) -> Pair:
    """The normal equations of a stop's pose in a map of 1000 points."""
    mapped, weights, cell_m = on_walls(rng, 1000), rng.uniform(0.5, 2.0, 1000), 0.15
    mapped_cells = np.floor(mapped[:, ::-1] / cell_m).astype(np.int64)
    sums = np.zeros((16, 16, 7))
    np.add.at(sums, (mapped_cells[:, 0], mapped_cells[:, 1]), moments_of(mapped, weights))
    points, position = on_walls(rng, READINGS), np.array([0.9, 0.4])
    cells = np.floor(points[:, ::-1] / cell_m).astype(np.int64)
    beams = wall_lines.MapPoints(points - position, *beams_to(rng, READINGS))
    return (
        lambda: wall_lines.equations_on_lines(sums, cells, beams, position, CRITERIA),
        lambda: lines_reference.equations_on_lines(mapped, weights, cell_m, position, beams, CRITERIA),
    )


def stops_and_walls(rng: np.random.Generator) -> Pair:
    """The normal equations of 20 stops and their walls."""
    positions, stop = on_walls(rng, 2000), np.sort(rng.integers(0, 20, 2000))
    arms, beams = rng.normal(0.0, 0.5, (2000, 2)), beams_to(rng, 2000)
    bel = rng.choice([0.5, 1.0], 2000)
    points = wall_lines.StopPoints(stop, positions, bel, wall_lines.MapPoints(arms, *beams))
    problem = (*by_cell(positions, 0.15, 0.5), points, 20, CRITERIA)

    def in_full() -> object:
        J, distance, weights = lines_reference.rows_of_walls(*problem)
        return J.T @ (weights[:, None] * J), J.T @ (weights * distance)

    return lambda: wall_lines.equations_of_walls(*problem), in_full


def wheels(rng: np.random.Generator) -> Pair:
    """200 increments of wheels and gyro."""
    n, variances = 200, WheelGyroNoise().variances()
    forward, yaw = rng.uniform(-0.01, 0.03, n), rng.normal(0.0, 0.05, n)
    increments = wheel_gyro.WheelIncrements(
        forward, np.zeros(n), yaw, seconds=np.full(n, 0.05), gyro_rad=yaw, is_lost=np.zeros(n)
    )

    def kernel() -> object:
        return wheel_gyro.advance(
            np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4]), increments, variances, np.empty((n, 3))
        )

    def step_by_step() -> object:
        x, P = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4])
        for k in range(n):
            x, P = wheels_reference.step(x, P, increments, k, variances)
        return x, P

    return kernel, step_by_step
