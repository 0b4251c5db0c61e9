"""Cost of a filter round of ispace-mcl, of a search of the map, and of a camera frame, in CPU time on one core.

10,000 particles all over the sample corridor, 60 beams, one frame of three cameras with people and the robot in view; frames of
640 x 480 pixels with a person of 120 x 300 and a robot of 80 x 60 pixels. The map that is searched has 100 x 100 m at 5 cm, of
equal buildings: 300 beams are compared with all of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.filters.particles import Particles
from gridslam.filters.resampling import AdaptiveSize, resample
from gridslam.kernels.threads import on_threads
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ispace_mcl.cameras.environment import (
    CameraObservation,
    DensityWeight,
    DetectionWeight,
    moving_cells,
)
from gridslam.methods.ispace_mcl.config import LidarWeightName
from gridslam.methods.ispace_mcl.scan_agreement import BLOCKED_TOLERANCE_M, GRAZING_SLACK_M
from gridslam.methods.ispace_mcl.search.relocalization import SEARCH, SEARCHED, Relocalizer
from gridslam.methods.ispace_mcl.weighing import log_weight_of
from gridslam.motion.odometry_model import OdometryNoise, sample_motion
from gridslam.sensors.fixed_camera import COLOUR_AND_DEPTH, FixedCamera, FloorDetections
from gridslam.sensors.floor_cells import FloorCells
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field, occupied_cells
from gridslam.sensors.pinhole import Pinhole
from gridslam.sensors.pose_search import PoseSearch
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import BeamSegments, VisibilityField
from tests.benchmarks.harness import BenchmarkRow
from tests.conftest import REPOSITORY
from tests.methods.ispace_mcl.building import building

ALONE = True

PARTICLES, BEAMS = 10_000, 60
SEARCHED_M, SEARCHED_CELL_M = 100.0, 0.05
ROWS, COLS = 480, 640
WEIGHTS: tuple[LidarWeightName, ...] = ("likelihood-field", "beam", "range-difference")


def rows() -> Iterator[BenchmarkRow]:
    """The steps of a round, and frames a second of subtraction and projection."""
    cv2.setNumThreads(1)
    with on_threads(1):
        yield from round_rows()
        yield BenchmarkRow("ispace.search", 1e-3 * search_ms(), "s")
    yield BenchmarkRow("ispace.camera.frames", 1e3 / frame_ms(), "/s")


def round_rows() -> Iterator[BenchmarkRow]:
    """Propagate, weigh (by each model), environment (by each weight), resample."""
    grid = load_map(REPOSITORY / "sample_logs" / "ispace-mcl.truth" / "map.yaml")
    rng = np.random.default_rng(0)
    poses = draw_free_poses(free_cells(grid, 0.3), grid, PARTICLES, rng)
    noise = OdometryNoise(
        alpha1=0.1, alpha2=0.01, alpha3=0.03, alpha4=0.005, wild_fraction=0.05, wild_factor=3.0
    )
    step = np.array([0.2, 0.0, 0.02])
    yield BenchmarkRow("ispace.propagate", cpu_ms(lambda: sample_motion(poses, step, noise, rng)), "ms")
    occupied = occupied_cells(grid, 0.65)
    field = distance_field(occupied, grid.geometry, 2.0)
    beams, nothing = scan(rng), np.zeros((0, 2))
    for name in WEIGHTS:
        weigh = log_weight_of(name, field, occupied, BEAMS)
        cost = cpu_ms(lambda weigh=weigh: weigh(beams, poses, nothing))
        yield BenchmarkRow(f"ispace.weigh.{name}", cost, "ms")
    observations, particles = [observation(k, rng) for k in range(3)], Particles.even(poses)
    detection = DetectionWeight()
    cost = cpu_ms(lambda: particles.reweighted(detection.log_likelihood(observations, poses)))
    yield BenchmarkRow("ispace.environment.detection", cost, "ms")
    density = DensityWeight(as_printed=False)
    yield BenchmarkRow(
        "ispace.environment.density", cpu_ms(lambda: density.reweighted(observations, particles)), "ms"
    )
    size = AdaptiveSize(min=PARTICLES, max=PARTICLES, error=0.02, quantile=2.33, bin_m=0.25, bin_rad=0.175)
    uneven = Particles(poses, rng.dirichlet(np.ones(PARTICLES)))
    yield BenchmarkRow("ispace.resample", cpu_ms(lambda: resample(uneven, size, rng)), "ms")


def search_ms() -> float:
    """A search of a map of 100 x 100 m for 300 beams."""
    tile = np.kron(building().probability, np.ones((2, 2), np.float32))
    cells = int(SEARCHED_M / SEARCHED_CELL_M)
    tiled = np.tile(tile, [-(-cells // n) for n in tile.shape])[:cells, :cells]
    grid = OccupancyGrid(np.ascontiguousarray(tiled), GridGeometry(SEARCHED_CELL_M, (0.0, 0.0)))
    occupied, free = occupied_cells(grid, 0.65), free_cells(grid, 0.3)
    field, caster = distance_field(occupied, grid.geometry, 2.0), range_caster(occupied, grid.geometry)
    visibility = VisibilityField(field, caster, BLOCKED_TOLERANCE_M, GRAZING_SLACK_M)
    relocalizer = Relocalizer(
        PoseSearch(field, free, SEARCH), visibility, lambda seen, poses: np.zeros(len(poses))
    )
    pose = draw_free_poses(free, grid, 1, np.random.default_rng(2))
    bearings = np.linspace(-np.pi, np.pi, SEARCHED[0][1], endpoint=False)
    ranges = caster.ranges(pose, bearings, np.zeros(3), 10.0)[0]
    points = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    return cpu_ms(lambda: relocalizer.search(BeamSegments(np.zeros_like(points), points)), 5)


def scan(rng: np.random.Generator) -> Beams:
    """Beams all around, of one to five metres, more than are used."""
    count = 6 * BEAMS
    bearings, ranges = np.linspace(-2.0, 2.0, count), rng.uniform(1.0, 5.0, count)
    points = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    return Beams(
        ranges=ranges,
        bearings=bearings,
        returned=np.ones(count, bool),
        points=points,
        extrinsics=np.zeros(3),
        max_range_m=5.6,
        unreadable=0,
    )


def observation(number: int, rng: np.random.Generator) -> CameraObservation:
    """A camera's view of 8 m of the corridor with two people in it, from 0.2 s ago."""
    coverage = FloorCells(np.argwhere(np.ones((80, 26))) + np.array([100 * number, 0]), 0.1)
    people = coverage.centres[rng.integers(len(coverage), size=2)]
    points = np.concatenate([person + rng.normal(0.0, 0.15, (2000, 2)) for person in people])
    detections = FloorDetections(points, np.full(len(points), 2e-4), np.ones(len(coverage), bool))
    moving = moving_cells(detections, COLOUR_AND_DEPTH.cell_m, COLOUR_AND_DEPTH.min_area_m2)
    return CameraObservation(moving, coverage, np.array([-0.1, 0.0, 0.0]))


def frame_ms() -> float:
    """A frame of 640 x 480: subtraction on colour and depth, projection, coverage."""
    rotation = np.column_stack([[0.0, -1.0, 0.0], [-0.47, 0.0, -0.88], [0.88, 0.0, -0.47]])
    pinhole = Pinhole((480.0, 480.0), (319.5, 239.5), rotation, np.array([0.0, 1.3, 2.4]))
    cells = FloorCells(np.argwhere(np.ones((300, 26))), 0.1)
    camera = FixedCamera(pinhole, COLOUR_AND_DEPTH, cells)
    rng = np.random.default_rng(1)
    still = [rng.normal(120.0, 1.0, (ROWS, COLS, 3)).astype(np.uint8) for _ in range(8)]
    depth = rng.normal(5.0, 0.02, (ROWS, COLS)).astype(np.float32)
    for picture in still:
        camera.detect(picture, depth)
    shown = [picture.copy() for picture in still]
    for k, picture in enumerate(shown):
        picture[100:400, 100 + 20 * k : 220 + 20 * k] = (180, 60, 60)
        picture[300:360, 420 + 10 * k : 500 + 10 * k] = (60, 60, 70)
    near = depth.copy()
    near[100:400, 100:360] = near[300:360, 420:570] = 3.5
    count = iter(range(10**9))
    return cpu_ms(lambda: camera.detect(shown[next(count) % len(shown)], near))


def cpu_ms(run: Callable[[], object], repeats: int = 15) -> float:
    """Milliseconds of CPU of one run: the smallest of several after a first one."""
    run()
    costs = []
    for _ in range(repeats):
        started = time.process_time()
        run()
        costs.append(time.process_time() - started)
    return 1e3 * min(costs)
