"""The kernels of ir-scan beside their reference implementations: grids, matching, wall lines, wheels and gyro."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels import infrared, wall_lines, wheel_gyro
from gridslam.methods.ir_scan.adjustment import by_cell
from gridslam.methods.ir_scan.lines import moments
from gridslam.motion.wheel_gyro import WheelGyroNoise
from tests.benchmarks.harness import Row
from tests.benchmarks.kernel_pairs import Floats, Pair, rows_of_pairs
from tests.reference import infrared as reference
from tests.reference import wall_lines as lines_reference
from tests.reference import wheel_gyro as wheels_reference

ALONE = True

READINGS, CELLS, REACH = 180, 400, 10  # of a stop; of a map 4 m wide; of the matching, in cells
WALLS = (4.0, 0.05, 1e-5, 2.5)  # least points, thickness (m), variance of the map (m2), robust sigmas


def rows() -> Iterator[Row]:
    """What a stop costs."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("add_readings", 150.0, drawing(rng)),
            ("count_crossed", 150.0, crossing(rng)),
            ("add_spots", 30.0, spots(rng)),
            ("shifted_sums", 600.0, shifting(rng)),
            ("shifted_changes", 600.0, changing(rng)),
            ("pooled_sums", 30.0, pooling(rng)),
            ("equations_on_lines", 400.0, pose_on_lines(rng)),
            ("equations_of_walls", 90.0, places_and_walls(rng)),
            ("wheel_gyro", 40.0, wheels(rng)),
        )
    )


def ends_in_cells(rng: np.random.Generator) -> NDArray[np.int64]:
    """The cells (row, col) in which the readings of a stop in the middle of the map end."""
    bearings, ranges = np.linspace(-np.pi, np.pi, READINGS), rng.uniform(20.0, 150.0, READINGS)
    ends = np.stack([ranges * np.sin(bearings), ranges * np.cos(bearings)], axis=1) + 0.5 * CELLS
    return ends.astype(np.int64)


def drawing(rng: np.random.Generator) -> Pair:
    """The readings of a stop into the map."""
    ends, bel = ends_in_cells(rng), np.full(READINGS, 0.5)
    starts, pos = np.full((READINGS, 2), CELLS // 2), np.zeros((CELLS, CELLS))
    readings = [((a, b), (c, d)) for (a, b), (c, d) in zip(starts.tolist(), ends.tolist(), strict=True)]
    return (
        lambda: infrared.add_readings(pos, starts, ends, bel),
        lambda: [reference.add_reading(pos, *reading, 0.5) for reading in readings],
    )


def crossing(rng: np.random.Generator) -> Pair:
    """The cells that the readings of a stop pass."""
    ends, crossed = ends_in_cells(rng)[:, ::-1] + 0.37, np.zeros((CELLS, CELLS))
    starts = np.full((READINGS, 2), 0.5 * CELLS + 0.41)
    return (
        lambda: infrared.count_crossed(crossed, starts, ends),
        lambda: reference.count_crossed(crossed, starts, ends),
    )


def spots(rng: np.random.Generator) -> Pair:
    """A spot of 9 x 9 cells about each reading, against numpy."""
    values, spot = np.zeros((CELLS, CELLS)), rng.random((9, 9))
    cells, weights = ends_in_cells(rng), rng.random(READINGS)
    return (
        lambda: infrared.add_spots(values, cells, spot, weights),
        lambda: reference.add_spots(values, cells, spot, weights),
    )


def shifting(rng: np.random.Generator) -> Pair:
    """The sums under the readings at 21 x 21 shifts."""
    values, cells = rng.standard_normal((CELLS, CELLS)), ends_in_cells(rng)
    return (
        lambda: infrared.shifted_sums(values, cells, REACH),
        lambda: reference.shifted_sums(values, cells, REACH),
    )


def changing(rng: np.random.Generator) -> Pair:
    """What these sums change by from one shift to the others."""
    values, cells = rng.standard_normal((CELLS, CELLS)), ends_in_cells(rng)
    return (
        lambda: infrared.shifted_changes(values, cells, REACH, -2, 3),
        lambda: reference.shifted_changes(values, cells, REACH, -2, 3),
    )


def pooling(rng: np.random.Generator) -> Pair:
    """The sums of 5 x 5 cells about each reading, against numpy."""
    values, cells = rng.standard_normal((CELLS, CELLS, 7)), ends_in_cells(rng)
    return (
        lambda: wall_lines.pooled_sums(values, cells, 2),
        lambda: lines_reference.pooled_sums(values, cells, 2),
    )


def on_walls(rng: np.random.Generator, n: int) -> Floats:
    """Points near two walls."""
    along, off = rng.uniform(0.0, 2.0, n), rng.normal(0.0, 0.01, n)
    one, other = np.stack([along, 0.7 + off], axis=1), np.stack([1.1 + off, along], axis=1)
    return np.where(rng.random(n)[:, None] < 0.5, one, other)


def beams_to(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Directions of n beams, and the variances of their ends along and across."""
    angles = rng.uniform(-np.pi, np.pi, n)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1), rng.uniform(1e-5, 1e-3, (n, 2))


def pose_on_lines(rng: np.random.Generator) -> Pair:
    """The normal equations of a stop's pose in a map of 1000 points."""
    mapped, weights, cell_m = on_walls(rng, 1000), rng.uniform(0.5, 2.0, 1000), 0.15
    at = np.floor(mapped[:, ::-1] / cell_m).astype(np.int64)
    sums = np.zeros((16, 16, 7))
    np.add.at(sums, (at[:, 0], at[:, 1]), moments(mapped, weights))
    points, position = on_walls(rng, READINGS), np.array([0.9, 0.4])
    cells, beams = np.floor(points[:, ::-1] / cell_m).astype(np.int64), beams_to(rng, READINGS)
    arms, (least, thickest, variance, robust) = points - position, WALLS

    def kernel() -> object:
        return wall_lines.equations_on_lines(
            sums, cells, least, thickest, arms, *beams, variance, robust, position
        )

    return kernel, lambda: lines_reference.equations_on_lines(
        mapped, weights, cell_m, points, arms, *beams, *WALLS
    )


def places_and_walls(rng: np.random.Generator) -> Pair:
    """The normal equations of 20 stops and the walls that they see."""
    points, place = on_walls(rng, 2000), np.sort(rng.integers(0, 20, 2000))
    problem = (
        *by_cell(points, 0.15, 0.5),
        place,
        points,
        rng.normal(0.0, 0.5, (2000, 2)),
        *beams_to(rng, 2000),
        rng.choice([0.5, 1.0], 2000),
    )

    def in_full() -> object:
        J, off, weights = lines_reference.rows_of_walls(*problem, *WALLS, 20)
        return J.T @ (weights[:, None] * J), J.T @ (weights * off)

    return lambda: wall_lines.equations_of_walls(*problem, *WALLS, 20), in_full


def wheels(rng: np.random.Generator) -> Pair:
    """200 increments of wheels and gyro."""
    n, variances = 200, WheelGyroNoise().variances()
    ways, turns = rng.uniform(-0.01, 0.03, n), rng.normal(0.0, 0.05, n)
    increments = np.column_stack([ways, np.zeros(n), turns, np.full(n, 0.05), turns, np.zeros(n)])

    def kernel() -> object:
        return wheel_gyro.advance(
            np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4]), increments, variances, np.empty((n, 3))
        )

    def step_by_step() -> object:
        x, P = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4])
        for increment in increments:
            x, P = wheels_reference.step(x, P, increment, variances)
        return x, P

    return kernel, step_by_step
