"""The kernels of localization and of the tagged objects beside their slow reference implementations.

bench_localize.py holds weighting, resampling and ray casting against numpy's best as well, on whole maps with 10,000 particles.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.kernel_density import kernel_density
from gridslam.kernels import object_weights
from gridslam.kernels.drawings import drawn_field
from gridslam.kernels.grids import raycast
from gridslam.kernels.localization import likelihood_field, mcl
from gridslam.kernels.localization.beam import MeasuredBeams, RangeTable, sum_over_ranges
from gridslam.kernels.localization.likelihood_field import BeamCells, VisibilityMap
from gridslam.sensors.rfid import OPEN_M, PROFILE_BINS, AntennaModel
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.kernel_pairs import Floats, Pair, rows_of_pairs
from tests.reference import drawn_field as drawn_reference
from tests.reference import mcl as reference
from tests.reference import object_weights as objects_reference
from tests.reference.kernel_density import density_at
from tests.reference.ray_traversal import cast_cell_by_cell, largest_free_square

ALONE = True

BEAMS, PARTICLES, MAX_RANGE = 60, 200, 300.0  # range in cells


def rows() -> Iterator[BenchmarkRow]:
    """Weights of particles on a map, resampling, and the weights of objects' poses."""
    rng = np.random.default_rng(0)
    occupied = rooms()
    return rows_of_pairs(
        (
            ("free_squares", 2000.0, squares_of(occupied)),
            ("cast_rays", 100.0, casting(occupied, rng)),
            ("sum_over_points", 60.0, weights_by_points(occupied, rng)),
            ("sum_over_beams", 60.0, weights_with_visibility(occupied, rng)),
            ("sum_over_ranges", 100.0, weights_by_ranges(occupied, rng)),
            ("sum_over_offsets", 1.0, scores_of_positions(rng)),
            ("sum_over_stretched_points", 40.0, weights_in_a_drawing(rng)),
            ("systematic", 2500.0, resampling(rng)),
            ("occupied_bins", 40.0, counting(rng)),
            ("kernel_density", 15.0, density(rng)),
            ("footprint_gains", 2500.0, gains_of_footprints(rng)),
            ("distances_behind", 1000.0, faces_of_a_footprint(rng)),
            ("mark_points_on", 300.0, points_of_a_footprint(rng)),
            ("tag_log_likelihood", 25.0, visibility_of_tags(rng)),
        )
    )


def rooms() -> NDArray[np.bool_]:
    """Sixteen rooms of 50 x 50 cells with doors."""
    occupied = np.zeros((200, 200), bool)
    occupied[::50] = occupied[:, ::50] = occupied[-1] = occupied[:, -1] = True
    for k in range(25, 200, 50):
        occupied[k - 5 : k + 5, 1:-1] = False
        occupied[1:-1, k - 5 : k + 5] = False
    return occupied


def poses_in(occupied: NDArray[np.bool_], rng: np.random.Generator) -> Floats:
    """Particles in free cells."""
    free = np.argwhere(~occupied)
    places = free[rng.integers(len(free), size=PARTICLES), ::-1] + rng.random((PARTICLES, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, PARTICLES)])


def endpoints(rng: np.random.Generator) -> Floats:
    """Endpoints of a scan's beams in the robot's frame, in cells."""
    bearings, ranges = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False), rng.uniform(5.0, 60.0, BEAMS)
    return np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)


def squares_of(occupied: NDArray[np.bool_]) -> Pair:
    """The free squares of a room of 51 x 51 cells."""
    room = np.ascontiguousarray(occupied[:51, :51])
    cells = [(row, col, quadrant) for row in range(51) for col in range(51) for quadrant in range(4)]
    return lambda: raycast.free_squares(room), lambda: [largest_free_square(room, *cell) for cell in cells]


def casting(occupied: NDArray[np.bool_], rng: np.random.Generator) -> Pair:
    """20 rays from each of 200 poses."""
    squares, poses = raycast.free_squares(occupied), poses_in(occupied, rng)
    bearings = np.linspace(-np.pi, np.pi, 20, endpoint=False)

    def slow() -> object:
        return [
            cast_cell_by_cell(occupied, x, y, yaw + bearing, MAX_RANGE)
            for x, y, yaw in poses.tolist()
            for bearing in bearings.tolist()
        ]

    return lambda: raycast.cast_rays(squares, poses, bearings, MAX_RANGE), slow


def weights_by_points(occupied: NDArray[np.bool_], rng: np.random.Generator) -> Pair:
    """A scan of 60 end points seen by 200 particles."""
    field, table = rng.integers(0, 256, occupied.shape).astype(np.uint8), rng.random(256).astype(np.float32)
    points, poses = endpoints(rng), poses_in(occupied, rng)
    in_single = points.astype(np.float32)
    return (
        lambda: likelihood_field.sum_over_points(field, table, in_single, poses),
        lambda: [reference.sum_over_points(field, table, points, pose) for pose in poses],
    )


def weights_with_visibility(occupied: NDArray[np.bool_], rng: np.random.Generator) -> Pair:
    """The same, with a check whether walls block the beams."""
    squares, field = raycast.free_squares(occupied), rng.integers(0, 255, occupied.shape).astype(np.uint8)
    table = rng.random(256).astype(np.float32)
    points, poses = endpoints(rng), poses_in(occupied, rng)
    beams, walls = BeamCells(np.zeros_like(points), points), VisibilityMap(field, squares, 1.5, 0.0)
    return (
        lambda: likelihood_field.sum_over_beams(walls, table, beams, poses),
        lambda: [reference.sum_over_beams(field, occupied, table, beams, 1.5, pose) for pose in poses],
    )


def weights_by_ranges(occupied: NDArray[np.bool_], rng: np.random.Generator) -> Pair:
    """The beam model of 20 beams for 200 particles."""
    squares, table = raycast.free_squares(occupied), rng.random((300, 300)).astype(np.float32)
    bearings, measured = np.linspace(-2.0, 2.0, 20), rng.integers(0, 300, 20)
    scan = (RangeTable(table, 1.0), MeasuredBeams(bearings, measured, np.array([0.7, -0.4, 0.3]), MAX_RANGE))
    poses = poses_in(occupied, rng)
    return (
        lambda: sum_over_ranges(squares, *scan, poses),
        lambda: [reference.sum_over_ranges(occupied, *scan, pose) for pose in poses],
    )


def scores_of_positions(rng: np.random.Generator) -> Pair:
    """A scan of 60 points at 4000 positions under 16 headings, against numpy."""
    scores = rng.integers(0, 256, 60_000).astype(np.uint8)
    starts = rng.integers(0, 30_000, 4000).astype(np.int32)
    offsets = rng.integers(0, 30_000, (16, BEAMS)).astype(np.int32)
    return (
        lambda: likelihood_field.sum_over_offsets(scores, starts, offsets),
        lambda: scores[starts[None, :, None] + offsets[:, None, :]].sum(axis=2, dtype=np.int32),
    )


def weights_in_a_drawing(rng: np.random.Generator) -> Pair:
    """A scan of 60 points seen by 200 particles in a drawing of unknown scales."""
    field, table = rng.uniform(0.0, 3.0, (200, 200)).astype(np.float32), rng.random(64).astype(np.float32)
    points, places = rng.uniform(-6.0, 6.0, (BEAMS, 2)), rng.uniform(3.0, 17.0, (PARTICLES, 2))
    rest = rng.uniform([-3.0, -0.3, -0.3], [3.0, 0.3, 0.3], (PARTICLES, 3))
    states, drawing = np.column_stack([places, rest]), (field, 0.1, table, 30.0, points)
    return (
        lambda: drawn_field.sum_over_stretched_points(*drawing, states),
        lambda: [drawn_reference.sum_over_stretched_points(*drawing, state) for state in states],
    )


def resampling(rng: np.random.Generator) -> Pair:
    """Systematic resampling of 1000 particles."""
    weights = rng.random(1000) ** 4
    as_list = weights.tolist()
    return lambda: mcl.systematic(weights, 1000, 0.4), lambda: reference.systematic(as_list, 1000, 0.4)


def counting(rng: np.random.Generator) -> Pair:
    """The bins that 5000 of 5000 particles lie in."""
    poses, chosen = rng.normal(0.0, 1.0, (5000, 3)), rng.integers(0, 5000, 5000)
    return (
        lambda: mcl.occupied_bins(poses, chosen, 0.25, 0.175),
        lambda: reference.occupied_bins(poses, chosen.tolist(), 0.25, 0.175),
    )


def density(rng: np.random.Generator) -> Pair:
    """The density of 500 particles at 200 places: by bins and a filter, against the sum."""
    points, weights = rng.normal(0.0, [2.0, 0.7], (500, 2)), rng.random(500)
    places, in_lists = points[:200].tolist(), points.tolist()
    return (
        lambda: kernel_density(points, weights, 0.3).at(points[:200]),
        lambda: [density_at(place, in_lists, weights.tolist(), 0.3) for place in places],
    )


BOX = np.array([[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]])


def beams_around(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """Beams `(n, 4)` and their ranges."""
    angle = rng.uniform(-np.pi, np.pi, n)
    beams = np.column_stack([rng.uniform(-2.0, 2.0, (n, 2)), np.cos(angle), np.sin(angle)])
    return beams, rng.uniform(0.1, 3.0, n)


def gains_of_footprints(rng: np.random.Generator) -> Pair:
    """20 poses of a box in 60 beams."""
    poses = rng.uniform([-1.0, -1.0, -3.0], [1.0, 1.0, 3.0], (20, 3))
    beams = object_weights.ObservedBeams(*beams_around(rng, 60), np.where(rng.random(60) < 0.5, np.inf, 0.02))
    scan = (BOX, beams, object_weights.EndpointMixture(0.02, 0.05, 0.3))
    return (
        lambda: object_weights.footprint_gains(poses, *scan),
        lambda: [objects_reference.footprint_gain(pose, *scan) for pose in poses],
    )


def faces_of_a_footprint(rng: np.random.Generator) -> Pair:
    """The faces of a box that 200 beams meet."""
    beams, ranges = beams_around(rng, 200)
    return (
        lambda: object_weights.distances_behind(BOX, beams, ranges),
        lambda: [objects_reference.face_met(BOX, beam) for beam in beams],
    )


def points_of_a_footprint(rng: np.random.Generator) -> Pair:
    """Which of 500 points lie on a box."""
    points = rng.uniform(-0.5, 0.5, (500, 2))
    return (
        lambda: object_weights.mark_points_on(points, BOX, 0.05, np.zeros(500, np.bool_)),
        lambda: [objects_reference.is_on(point, BOX, 0.05) for point in points],
    )


def visibility_of_tags(rng: np.random.Generator) -> Pair:
    """50 poses of a tag in 40 rounds of the reader."""
    tags, antennas = (rng.uniform([-2.0, -2.0, -3.0], [2.0, 2.0, 3.0], (n, 3)) for n in (50, 40))
    model, is_read = AntennaModel(), rng.random(40) < 0.5
    profiles, parameters = np.full((1, PROFILE_BINS), OPEN_M), model.parameters
    first_scan, eye = np.zeros(40, np.int64), np.zeros((1, 3))

    def kernel() -> object:
        rounds = object_weights.ReaderRounds(antennas, first_scan, eye, profiles)
        return object_weights.tag_log_likelihood(tags, rounds, is_read, 0.3, parameters)

    return kernel, lambda: [
        objects_reference.read_probability(tag, antenna, False, model) for tag in tags for antenna in antennas
    ]
