"""The doubt about a map: wrong maps are doubted, right ones are not, whatever moved meanwhile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.config import ScanConfig
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.map_consistency.assessment import MapConsistency, assess_map
from gridslam.lidar_slam.map_consistency.contradictions import Contradiction
from gridslam.lidar_slam.map_consistency.displacement import Displacement
from gridslam.lidar_slam.map_consistency.doubtful_places import agreeing_evidence, doubt_of
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.sensors.lidar_beams import LidarExtrinsics
from gridslam.simulation.scene import Scene
from gridslam.simulation.world_config import validate_world

Floats = NDArray[np.float64]

WALLS: list[dict[str, Any]] = [{"rectangle": [0, 0, 30, 20]}, {"rectangle": [3, 3, 27, 17]}]
ANGLES = np.linspace(-np.pi, np.pi, 360, endpoint=False)
CORNERS = np.array([(1.5, 1.5), (28.5, 1.5), (28.5, 18.5), (1.5, 18.5)])
STEP_M = 0.5


def lap() -> Floats:
    """Poses `(n, 3)` once around the ring."""
    pieces = []
    for start, end in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True):
        span = end - start
        count = int(np.hypot(*span) / STEP_M)
        yaw = np.full(count, np.arctan2(span[1], span[0]))
        pieces.append(np.column_stack([start + np.arange(count)[:, None] / count * span, yaw]))
    return np.concatenate(pieces)


def scans_of(laps: list[list[dict[str, Any]]]) -> tuple[list[PreparedScan], Floats]:
    """Key scans of as many laps as there are lists of boxes that stand there meanwhile, and their true poses."""
    rng = np.random.default_rng(1)
    scans, poses = [], []
    for boxes in laps:
        document = {"walls": WALLS, "boxes": boxes, "robot": {"start": [1.5, 1.5, 0]}}
        scene = Scene(validate_world(document, "ring"), Path())
        for pose in lap():
            yaw = pose[2] + ANGLES
            rays = np.column_stack([np.tile(pose[:2], (360, 1)), np.cos(yaw), np.sin(yaw)])
            ranges = scene.cast(rays, 30.0, 0.0).ranges_m + rng.normal(0.0, 0.01, 360)
            step = float(ANGLES[1] - ANGLES[0])
            scan = LaserScan(
                len(scans), "laser", ranges.astype(np.float32), float(ANGLES[0]), step, 0.05, 30.0
            )
            scans.append(prepare_scan(scan, LidarExtrinsics(np.zeros(3)), np.zeros(3), ScanConfig()))
            poses.append(pose)
    return scans, np.array(poses)


def box(x: float, y: float, length: float) -> dict[str, Any]:
    return {"centre": [x, y], "size": [length, 0.3]}


def two_laps(boxes: list[dict[str, Any]] | None = None) -> tuple[list[PreparedScan], Floats]:
    return scans_of([[], boxes or []])


def jittered(poses: Floats) -> Floats:
    return poses + np.random.default_rng(2).normal(0.0, 1.0, poses.shape) * [0.02, 0.02, 0.003]


def shifted(poses: Floats, x: float) -> Floats:
    """The second half of the path, put elsewhere."""
    moved = poses.copy()
    moved[len(poses) // 2 :, 0] += x
    return moved


def test_a_right_map_is_not_doubted() -> None:
    scans, poses = two_laps()
    found = assess_map(scans, jittered(poses), poses)
    assert found.doubt < 0.15
    assert {place.kind for place in found.places} <= {"strain"}  # the scans' poses are not without noise
    assert found.revisited > 0.95
    assert found.compared_wall_m > 100.0


def test_a_map_with_a_passage_put_elsewhere_is_doubted_where_it_is_wrong() -> None:
    scans, poses = two_laps()
    found = assess_map(scans, shifted(poses, 1.5), poses)
    assert found.is_doubtful
    assert found.doubt > 0.95
    worst = found.places[0]
    assert worst.kind == "contradiction"
    assert worst.size_m == pytest.approx(1.5, abs=0.4)  # the displacement
    assert found.contradicted_wall_m > 20.0
    assert min(abs(worst.x_m - x) for x in (0.0, 1.5, 3.0, 4.5, 27.0, 28.5, 30.0, 31.5)) < 1.0
    assert "contradicts itself near" in found.summary
    assert worst.stamps_ns[0] != worst.stamps_ns[1]


def test_a_box_that_was_moved_is_not_a_wrong_map() -> None:
    scans, poses = two_laps([box(15.0, 0.4, 1.2)])
    assert assess_map(scans, jittered(poses), poses).doubt < 0.4


def test_what_its_own_passage_sees_through_is_left_out() -> None:
    scans, poses = two_laps()
    rng = np.random.default_rng(3)
    ghosts = []
    for scan in scans:  # a wall of 3 m in each scan, at another place each time
        ghost = rng.uniform(-1.0, 1.0, 2) + np.column_stack([np.linspace(-0.5, 0.5, 20), np.zeros(20)])
        chosen = np.concatenate([scan.points, ghost])
        normals = np.concatenate([scan.normals, np.zeros((20, 2))])
        ghosts.append(
            PreparedScan(
                scan.stamp_ns,
                scan.viewpoint,
                scan.returns,
                chosen,
                normals,
                scan.surface,
                scan.surface_normals,
            )
        )
    assert assess_map(ghosts, jittered(poses), poses).doubt < 0.3


def test_a_strained_path_is_doubted_even_if_nothing_contradicts_it() -> None:
    scans, poses = scans_of([[]])
    stretched = poses.copy()
    stretched[20:, 0] += 4.0
    found = assess_map(scans, stretched, poses)
    assert found.is_doubtful
    assert "departs by 4.0 m from what scan matching measured" in found.summary
    assert found.largest_strain > 50.0


def test_a_strain_over_a_long_path_is_doubted_where_no_short_piece_shows_it() -> None:
    scans, poses = scans_of([[]])
    scans, poses = scans[:50], poses[:50]
    longer = poses * [1.04, 1.0, 1.0]  # 2 cm a scan
    found = assess_map(scans, longer, poses)
    assert found.is_doubtful
    assert found.places[0].kind == "strain"
    assert found.places[0].size_m > 0.4
    assert assess_map(scans, longer, poses, drift=DriftModel(translation_m=0.2)).doubt < 0.1


def test_an_accepted_loop_that_is_not_met_is_doubted() -> None:
    scans, poses = two_laps()
    half = len(poses) // 2
    motion = se2.between(poses[[10]], poses[[half + 10]])
    motion[0, 0] += 1.0
    information = np.diag([1e4, 1e4, 1e6])[None]
    loops = Edges(np.array([10]), np.array([half + 10]), motion, information, np.array([True]))
    found = assess_map(scans, poses, poses, loops)
    assert found.largest_loop_residual == pytest.approx(100.0 / np.sqrt(3.0), rel=1e-6)
    assert found.is_doubtful
    assert "missed by 1.00 m" in found.summary


def test_a_map_without_a_place_seen_twice_cannot_be_judged() -> None:
    scans, poses = scans_of([[]])
    found = assess_map(scans[:60], poses[:60], poses[:60])
    assert found.doubt == 0.0
    assert found.summary == "doubt unknown: no place was seen twice"
    assert found.longest_unchecked_m == pytest.approx(29.5, abs=2.0)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_scans_give_no_doubt(count: int) -> None:
    scans, poses = scans_of([[]])
    assert isinstance(assess_map(scans[:count], poses[:count], poses[:count]), MapConsistency)


def test_contradictions_add_up_where_the_same_displacement_explains_them() -> None:
    none = np.zeros(0, np.int64)
    places = [Contradiction(x, 0.0, wall_m=2.0, points=none) for x in (0.0, 10.0, 20.0, 100.0)]
    shifts = [(1.2, 0.0), (-1.2, 0.4), (0.0, 1.2), (1.2, 0.0)]
    moved = [Displacement(x, y, gain=0.5, seen_by=0, looked_through_by=1) for x, y in shifts]
    # The first two agree, the third is explained otherwise, the last one is too far away.
    assert agreeing_evidence(places, moved) == [2.0, 2.0, 1.0, 1.0]


def test_doubt_grows_with_the_size_and_is_even_at_its_half() -> None:
    sizes = [0.0, 0.1, 1.0, 3.0, 10.0, 100.0]
    doubts = [doubt_of(size, 3.0) for size in sizes]
    assert doubts == sorted(doubts)
    assert doubt_of(3.0, 3.0) == 0.5
    assert doubts[0] == 0.0
    assert doubts[-1] < 1.0


def test_the_same_scans_give_the_same_measures() -> None:
    scans, poses = two_laps()
    first, second = (assess_map(scans, shifted(poses, 1.5), poses) for _ in range(2))
    assert first == second
