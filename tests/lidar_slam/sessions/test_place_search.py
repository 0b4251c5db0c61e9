"""Where a drive lies in a map is decided by how many of its parts agree, and by how much they contradict the map."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import directed_edges
from gridslam.lidar_slam.loop_closure.search import LoopMatches
from gridslam.lidar_slam.sessions.place_search import _is_borne_out, _is_enough, _largest_group

SEGMENTS = 12  # of the map, and of the drive
STEP = np.array([2.0, 0.0, 0.0])
PLACE, OTHER_PLACE = np.array([3.0, 1.0, 0.4]), np.array([-8.0, 5.0, 2.0])


def path(start: np.ndarray) -> np.ndarray:
    poses = [start]
    while len(poses) < SEGMENTS:
        poses.append(se2.compose(poses[-1], STEP))
    return np.array(poses)


def chain(first: int) -> Edges:
    rows = np.arange(first, first + SEGMENTS - 1)
    steps, information = np.tile(STEP, (len(rows), 1)), np.tile(np.eye(3) * 1e4, (len(rows), 1, 1))
    return Edges(rows, rows + 1, steps, information, np.zeros(len(rows), np.bool_))


def agreeing(right: int, wrong: int, contradicted: float) -> int:
    """How many matches are accepted, of some that put the drive in one place and some that put it in another."""
    known, drive = path(np.zeros(3)), path(np.zeros(3))
    placed = [PLACE] * right + [OTHER_PLACE] * wrong
    queries = np.arange(len(placed))
    motions = [
        se2.compose(se2.inverse(known[0]), se2.compose(place, drive[q]))
        for place, q in zip(placed, queries, strict=True)
    ]
    count = len(placed)
    edges = Edges(
        np.zeros(count, np.int64),
        queries + SEGMENTS,
        np.array(motions),
        np.tile(np.eye(3) * 400.0, (count, 1, 1)),
        np.ones(count, np.bool_),
    )
    rival = np.full(count, 0.5)
    pool = LoopMatches(
        edges,
        np.full(count, 100.0),
        np.full(count, 0.7),
        rival,
        np.full(count, 0.7),
        np.full(count, contradicted),
    )
    graph = directed_edges(2 * SEGMENTS, Edges.concatenate([chain(0), chain(SEGMENTS)]))
    group, rival = _largest_group(np.concatenate([known, drive]), graph, pool)
    return len(group) if _is_enough(group, rival, SEGMENTS) else 0


@pytest.mark.parametrize(
    ("right", "wrong", "contradicted", "accepted"),
    [
        (3, 0, 0.05, 3),
        (2, 0, 0.05, 0),
        (3, 2, 0.05, 0),  # too few more than elsewhere
        (3, 0, 0.2, 0),  # doors were open that are shut now: more parts must agree
        (4, 0, 0.2, 4),
        (4, 2, 0.2, 0),
        (6, 2, 0.2, 6),
    ],
)
def test_parts_that_contradict_the_map_must_be_more(
    right: int, wrong: int, contradicted: float, accepted: int
) -> None:
    assert agreeing(right, wrong, contradicted) == accepted


@pytest.mark.parametrize(
    ("is_enough", "fitting", "touching", "accepted"),
    [
        (True, 13, 13, True),
        (True, 3, 9, True),  # the drive leaves the map
        (True, 0, 2, True),  # too few around to say anything
        (True, 0, 9, False),  # one corridor looks alike, and nothing around it
        (True, 1, 12, False),
        (False, 8, 8, True),  # a corridor that looks alike all along, but all around it matches
        (False, 4, 4, False),
        (False, 7, 8, False),
    ],
)
def test_parts_around_those_that_agree_must_bear_them_out(
    is_enough: bool, fitting: int, touching: int, accepted: bool
) -> None:
    assert _is_borne_out(is_enough, fitting, touching) == accepted
