from __future__ import annotations

import bz2
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.readers.files import read_relations, read_trajectory
from gridslam.evaluation.relations import Relations, relation_errors


def relation(start_s: float, end_s: float, x: float, y: float, yaw: float) -> Relations:
    ends = np.array([[start_s, end_s]]) * 1e9
    return Relations(ends[:, 0].astype(np.int64), ends[:, 1].astype(np.int64), np.array([[x, y, yaw]]))


LINE = Trajectory(
    np.array([0, 2, 4]) * 10**9, np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, np.pi / 2]])
)


def test_poses_between_the_trajectorys_are_interpolated() -> None:
    found = relation_errors(LINE, relation(1.0, 3.0, 1.0, 0.0, np.pi / 4))
    assert found.errors.translation_m == pytest.approx([0.0])
    assert found.errors.rotation_deg == pytest.approx([0.0])


def test_an_error_is_measured_in_the_frame_of_the_true_pose() -> None:
    found = relation_errors(LINE, relation(0.0, 4.0, 2.3, 0.4, np.pi / 2 + 0.1))
    assert found.errors.translation_m == pytest.approx([0.5])
    assert found.errors.rotation_deg == pytest.approx([math.degrees(0.1)])


@pytest.mark.parametrize(("start", "end"), [(0.0, 4.5), (5.0, 6.0)])
def test_a_relation_outside_the_trajectory_is_missed(start: float, end: float) -> None:
    found = relation_errors(LINE, relation(start, end, 0.0, 0.0, 0.0))
    assert (len(found.errors.translation_m), found.missed) == (0, 1)


def test_the_order_of_the_trajectory_does_not_matter() -> None:
    shuffled = Trajectory(LINE.stamps_ns[[2, 0, 1]], LINE.poses[[2, 0, 1]])
    one, other = (relation_errors(t, relation(0.5, 3.5, 1.0, 0.2, 0.3)) for t in (LINE, shuffled))
    assert one.errors.translation_m == other.errors.translation_m


def straightforward(poses: list[tuple[float, ...]], lines: list[list[float]]) -> tuple[list[float], int]:
    """The metric with complex numbers, one relation at a time."""
    poses = sorted(poses)
    errors, missed = [], 0

    def pose_at(t: float) -> tuple[complex, float] | None:
        for before, after in itertools.pairwise(poses):
            if before[0] <= t <= after[0]:
                f = (t - before[0]) / (after[0] - before[0])
                yaw_change = math.remainder(after[3] - before[3], 2 * math.pi)
                a, b = complex(*before[1:3]), complex(*after[1:3])
                return a + f * (b - a), before[3] + f * yaw_change
        return None

    for t1, t2, x, y, *_ in lines:
        start, end = pose_at(t1), pose_at(t2)
        if start is None or end is None:
            missed += 1
            continue
        motion = (end[0] - start[0]) * complex(math.cos(start[1]), -math.sin(start[1]))
        errors.append(abs(motion - complex(x, y)))
    return errors, missed


def numbers(path: Path) -> list[list[float]]:
    lines = path.read_text().splitlines()
    return [[float(w) for w in line.split()] for line in lines if line.strip() and line[0] != "#"]


@pytest.mark.real_data
def test_gmappings_path_of_aces_scores_as_a_straightforward_computation_says(data_dir: Path) -> None:
    path, reference = data_dir / "lidar/aces.relations", data_dir / "lidar/aces.reference.txt"
    found = relation_errors(read_trajectory(reference), read_relations(path))
    expected, missed = straightforward([tuple(p) for p in numbers(reference)], numbers(path))
    assert found.missed == missed == 5
    assert found.errors.translation_m == pytest.approx(np.array(expected), abs=1e-6)
    # 0.060 is published for the poses at all scans; the reference has one pose in three seconds.
    assert found.errors.translation_m.mean() == pytest.approx(0.0705, abs=5e-5)


@pytest.mark.real_data
def test_the_odometry_of_aces_scores_as_the_data_sheet_says(data_dir: Path) -> None:
    stamps, poses = [], []
    text = bz2.decompress((data_dir / "lidar/aces.clf.bz2").read_bytes()).decode()
    for words in map(str.split, text.splitlines()):
        if words and words[0] == "FLASER":
            stamps.append(round(float(words[-3]) * 1e9))
            poses.append([float(w) for w in words[-6:-3]])
    odometry = Trajectory(np.array(stamps), np.array(poses))
    found = relation_errors(odometry, read_relations(data_dir / "lidar/aces.relations"))
    assert found.errors.translation_m.mean() == pytest.approx(0.55, abs=0.005)
    assert found.errors.translation_m.std() == pytest.approx(2.67, abs=0.005)
