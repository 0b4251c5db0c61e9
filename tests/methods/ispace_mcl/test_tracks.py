"""Moving objects are followed from frame to frame."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.methods.ispace_mcl.cameras.tracks import MAX_FRAMES, MovingObjectTracker, objects_of
from gridslam.sensors.floor_cells import FloorCells

S = 10**9


def at(*centres: tuple[float, float]) -> FloorCells:
    """Blocks of 3 x 3 cells of 0.1 m about the centres."""
    block = 0.1 * (np.argwhere(np.ones((3, 3))) - 1)
    points = np.concatenate([np.array(centre) + block for centre in centres] or [np.zeros((0, 2))])
    return FloorCells.containing(points, 0.1).unique()


def test_objects_are_the_connected_moving_cells() -> None:
    found = objects_of(at((1.05, 1.05), (1.45, 1.05), (4.05, 2.05)))
    assert sorted(len(cells) for cells in found) == [9, 18]  # a gap of one cell does not separate
    assert objects_of(at()) == []


def test_two_people_who_pass_each_other_keep_their_pasts() -> None:
    tracker = MovingObjectTracker()
    for k in range(5):
        objects = tracker.add(k * S // 2, at((1.05 + 0.4 * k, 1.05), (5.05 - 0.4 * k, 2.05)))
    for tracked in objects:
        lane = float(tracked.cells.centres[:, 1].mean())
        assert len(tracked.past) == 4
        assert all(cells.centres[:, 1].mean() == pytest.approx(lane) for _, cells in tracked.past)


def test_an_object_too_far_for_its_speed_or_not_detected_for_long_is_a_new_one() -> None:
    tracker = MovingObjectTracker()
    tracker.add(0, at((1.05, 1.05)))
    (far,) = tracker.add(S // 2, at((4.05, 1.05)))
    assert far.past == ()
    (late,) = tracker.add(3 * S, at((4.05, 1.05)))
    assert late.past == ()


def test_a_missed_frame_does_not_end_a_track_and_its_past_is_bounded() -> None:
    tracker = MovingObjectTracker()
    for k in range(3 * MAX_FRAMES):
        objects = tracker.add(k * S // 2, at() if k == 5 else at((1.05 + 0.1 * k, 1.05)))
    assert len(objects[0].past) == MAX_FRAMES


def test_whom_a_track_continues_is_uncertain_when_two_meet_and_part() -> None:
    tracker = MovingObjectTracker()
    for k in range(4):
        tracker.add(k * S // 2, at((1.05, 1.05), (3.05 - 0.4 * k, 1.55)))
    (joined,) = tracker.add(2 * S, at((1.05, 1.05), (1.45, 1.25)))
    assert joined.past == () and joined.was_expected
    parted = tracker.add(5 * S // 2, at((1.05, 1.05), (1.05, 1.65)))
    assert [tracked.past for tracked in parted] == [(), ()]
    again = tracker.add(3 * S, at((1.05, 1.05), (3.05, 1.65)))
    assert len(again[0].past) == 1
