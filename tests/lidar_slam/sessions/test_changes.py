"""Changes are found from the cells that two drives contradict each other in, however few of them poses cannot explain."""

from __future__ import annotations

import numpy as np

from gridslam.lidar_slam.sessions.changes import find_changes
from gridslam.lidar_slam.sessions.evidence import CellFrame, PlacedScans, collect_evidence

CELL_M, GAP_X_M = 0.05, 2.025
VIEWPOINT = np.array([0.025, 0.025])
SCANS = 5


def drive(is_shut: bool, half_width_cells: int) -> PlacedScans:
    """Scans towards a narrow gap between two posts, with a wall behind it; a door may shut the gap."""
    across = np.arange(-half_width_cells, half_width_cells + 1) * CELL_M + 0.025
    is_post = np.abs(np.arange(len(across)) - half_width_cells) == half_width_cells
    at_gap = np.column_stack([np.full(len(across), GAP_X_M), across])
    behind = VIEWPOINT + 1.5 * (at_gap - VIEWPOINT)
    ends = np.where((is_post | is_shut)[:, None], at_gap, behind)
    viewpoints = np.tile(VIEWPOINT, (SCANS, 1))
    return PlacedScans([ends] * SCANS, viewpoints, np.arange(SCANS, dtype=np.int64))


def changed_cells(half_width_cells: int) -> list[int]:
    """Numbers of cells of the changes after the door of a gap is shut."""
    drives = drive(False, half_width_cells), drive(True, half_width_cells)
    frame = CellFrame.around(drives, CELL_M, 100.0)
    before, after = (collect_evidence(each, frame) for each in drives)
    found = find_changes(before, after, earlier=drives[0], later=drives[1], frame=frame, drive=1)
    assert all(change.kind == "appeared" for change in found)
    return [len(change.cells) for change in found]


def test_a_door_is_found_of_which_few_cells_are_away_from_its_posts() -> None:
    assert changed_cells(3) == [5]


def test_what_stands_within_errors_of_the_poses_of_a_wall_is_no_change() -> None:
    assert changed_cells(2) == []
