"""Two maps of one place are found to be the same wherever their frames are; maps of different places are not."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.evaluation.document import evaluate
from gridslam.evaluation.inputs import EvaluationOptions, Result, Truth
from gridslam.evaluation.map_registration import register_maps
from gridslam.evaluation.remarks.sanity import remarks_of
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

CELL_M = 0.1
SEGMENTS = np.array([
    [0, 0, 12, 0], [12, 0, 12, 7], [12, 7, 0, 7], [0, 7, 0, 0], [4, 0, 4, 4.5], [4, 5.5, 4, 7], [7, 3, 12, 3],
    [1, 6, 2.5, 6], [9, 5, 9, 6], [5.5, 1, 6.2, 1.8],
])  # fmt: skip


def house(
    T_map_house: tuple[float, float, float] = (0.0, 0.0, 0.0), segments: np.ndarray = SEGMENTS
) -> OccupancyGrid:
    """The house drawn on a grid whose axes are those of the map frame."""
    pose = np.array(T_map_house)
    points = np.concatenate([np.linspace(s[:2], s[2:], 300) for s in segments])
    moved = se2.transform_points(pose, points)
    # Walls of whole metres lie on cell centres
    low = np.floor(moved.min(axis=0) / CELL_M) * CELL_M - 0.5 + 0.5 * CELL_M
    shape = np.ceil((moved.max(axis=0) - low) / CELL_M).astype(int) + 6
    probability = np.full((shape[1], shape[0]), 0.02, np.float32)
    cells = ((moved - low) / CELL_M).astype(int)
    probability[cells[:, 1], cells[:, 0]] = 0.98
    return OccupancyGrid(probability, GridGeometry(CELL_M, (float(low[0]), float(low[1]))))


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (-3.4, 2.2, 0.6), (20.0, -7.0, -2.8)])
def test_the_pose_of_a_map_is_found_from_its_walls(pose: tuple[float, float, float]) -> None:
    found = register_maps(house(pose), house())
    assert found is not None
    error = se2.compose(found.T_truth_map, pose)
    assert np.hypot(error[0], error[1]) < 0.5 * CELL_M
    assert abs(error[2]) < 0.005
    assert found.is_reliable
    assert not found.is_ambiguous


def test_a_symmetric_place_is_said_to_be_ambiguous() -> None:
    box = np.array([[0, 0, 9, 0], [9, 0, 9, 5], [9, 5, 0, 5], [0, 5, 0, 0]])
    found = register_maps(house((2.0, 1.0, 0.3), box), house(segments=box))
    assert found is not None
    assert found.is_ambiguous


def test_a_map_without_walls_cannot_be_registered() -> None:
    empty = OccupancyGrid(np.full((20, 20), 0.02, np.float32), GridGeometry(CELL_M, (0.0, 0.0)))
    assert register_maps(empty, house()) is None


def test_maps_in_different_frames_are_aligned_and_the_document_says_so() -> None:
    result, truth = Result(occupancy=house((-3.4, 2.2, 0.6))), Truth(occupancy=house())
    options = EvaluationOptions(align="se2")
    document = evaluate(result, truth, options)
    assert document["map"]["accuracy"]["mean"] < 0.5 * CELL_M
    assert document["map"]["alignment"]["kind"] == "registration"
    assert any("registration" in line for line in remarks_of(result, truth, options, document))
    as_given = evaluate(result, truth, EvaluationOptions(align="none"))
    assert as_given["map"]["accuracy"]["mean"] > 0.3
    assert "alignment" not in as_given["map"]
    remarks = remarks_of(result, truth, EvaluationOptions(align="none"), as_given)
    assert any("different frames" in line and "--align se2" in line for line in remarks)


def test_a_mirrored_map_is_named() -> None:
    image = OccupancyGrid(house().probability[::-1], house().geometry)
    result, truth, options = Result(occupancy=image), Truth(occupancy=house()), EvaluationOptions(align="se2")
    found = remarks_of(result, truth, options, evaluate(result, truth, options))
    assert any("the map is mirrored: with y negated 100% of its walls agree" in line for line in found)


def test_a_map_of_another_place_is_compared_as_it_is_and_the_remark_doubts_it() -> None:
    rng = np.random.default_rng(3)
    middles = rng.uniform(0.0, 30.0, (40, 2))
    directions = np.column_stack([np.cos(a := rng.uniform(0, np.pi, 40)), np.sin(a)]) * rng.uniform(
        0.4, 2.0, (40, 1)
    )
    other = house(segments=np.column_stack([middles - directions, middles + directions]))
    result, truth, options = Result(occupancy=other), Truth(occupancy=house()), EvaluationOptions(align="se2")
    document = evaluate(result, truth, options)
    assert document["map"]["alignment"]["kind"] == "none"
    assert any("maps of one place?" in line for line in remarks_of(result, truth, options, document))
