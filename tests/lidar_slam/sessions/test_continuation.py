"""Drives that continue a map from anywhere, and drives that never meet it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.lidar_slam.sessions import changes
from gridslam.lidar_slam.sessions.active_scans import active_keys
from gridslam.lidar_slam.sessions.session import Constraints, Session
from gridslam.lidar_slam.sessions.session_map import draw_session
from tests.lidar_slam.sessions.rings import LAP, PLACE, Floats, continued, drive_along, errors, session_of
from tests.methods.slam_sd import hall

HALF = len(LAP) // 2


@pytest.fixture(scope="module")
def first() -> Session:
    return session_of(drive_along(LAP, "monday"))


def backwards(truth: Floats) -> Floats:
    """The same path driven in the other direction."""
    return np.asarray(se2.compose(truth[::-1], np.array([0.0, 0.0, np.pi])))


def test_a_drive_that_starts_anywhere_in_the_map_is_found(first: Session) -> None:
    second = backwards(LAP[HALF - 40 : HALF + 60])
    found = continued(first, drive_along(second, "thursday", 1000))
    assert found.is_joined
    assert errors(found.session, [LAP, second]).max() < 0.06
    np.testing.assert_allclose(found.session.poses[0], first.poses[0], atol=1e-9)


def test_a_map_grows_by_a_drive_that_leaves_it() -> None:
    start, rest = LAP[: HALF + 35], LAP[HALF - 35 :]
    for one, other in ((start, rest), (rest, start)):
        found = continued(session_of(drive_along(one, "a")), drive_along(other, "b", 1000))
        assert found.is_joined
        assert errors(found.session, [one, other]).max() < 0.15


def test_parts_that_do_not_meet_are_kept_apart_and_continued_where_they_are() -> None:
    first_part, elsewhere = LAP[:60], np.array([1.6, 1.2])
    end = LAP * np.array([*elsewhere, 1.0])
    apart = continued(
        session_of(drive_along(first_part, "a")), drive_along(end, "b", 1000, PLACE * np.tile(elsewhere, 2))
    )
    assert not apart.is_joined
    assert apart.session.parts.tolist() == [0, 1]
    grid = draw_session(apart.session, 0.1, 100.0).grid
    assert np.isfinite(grid.probability).sum() > 0
    whole = continued(apart.session, drive_along(LAP, "c", 2000)).session
    assert whole.parts.tolist() == [0, 1, 0]
    np.testing.assert_allclose(whole.poses_of(1), apart.session.poses_of(1), atol=1e-9)
    both = Session(
        whole.drives[::2],
        np.concatenate([whole.poses_of(0), whole.poses_of(2)]),
        whole.parts[::2],
        whole.constraints,
    )
    assert errors(both, [first_part, LAP]).max() < 0.15


def test_what_was_moved_is_reported_and_the_map_shows_the_newest_state(first: Session) -> None:
    moved = [hall.box(7.0, -1.0, 7.5, -0.5), hall.box(12.5, 5.5, 13.0, 6.0)]
    is_kept = ~((PLACE[:, 0] >= 3.0) & (PLACE[:, 2] <= 3.6) & (PLACE[:, 1] >= -1.0) & (PLACE[:, 1] <= -0.6))
    walls = np.concatenate([PLACE[is_kept], *(np.array(box) for box in moved)])
    found = continued(first, drive_along(LAP, "thursday", 1000, walls))
    drawn = draw_session(found.session, 0.05, 100.0)
    places = sorted((change.kind, round(change.x_m), round(change.y_m)) for change in drawn.changes)
    assert ("vanished", 3, -1) in places
    assert {(kind, x) for kind, x, _ in places} == {("vanished", 3), ("appeared", 7), ("appeared", 13)}
    cell = drawn.grid.geometry.cells(np.array([[3.3, -0.6], [7.2, -0.5]]))
    values = drawn.grid.probability
    around = [values[r - 2 : r + 3, c - 2 : c + 3] for r, c in cell]
    assert np.nanmax(around[0]) < 0.5
    assert np.nanmax(around[1]) > 0.9
    assert (drawn.layer == -2).any() and (drawn.layer == 2).any()


def test_an_unchanged_place_has_no_changes(first: Session) -> None:
    found = continued(first, drive_along(LAP, "thursday", 1000))
    assert draw_session(found.session, 0.05, 100.0).changes == []


def test_walls_have_not_changed_where_a_drive_is_displaced(
    first: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    poses = np.concatenate([first.poses, first.poses + np.array([0.2, 0.0, 0.0])])
    both = Session(first.drives * 2, poses, np.zeros(2, np.int64), Constraints.none())

    def changed_cells() -> int:
        return sum(len(change.cells) for change in draw_session(both, 0.05, 100.0).changes)

    found = changed_cells()
    monkeypatch.setattr(changes, "DISPLACED_RATIO", 2.0)
    assert found < 0.3 * changed_cells()


def test_of_many_drives_through_one_place_the_last_two_are_active(first: Session) -> None:
    drives, poses = first.drives * 4, [first.poses] * 4
    turned = se2.compose(first.poses, np.array([0.0, 0.0, np.pi]))
    elsewhere = first.poses + np.array([100.0, 0.0, 0.0])
    active = active_keys(Session(drives, np.concatenate(poses), np.zeros(4, np.int64), Constraints.none()))
    assert [bool(one.all()) for one in active] == [False, False, True, True]
    assert not active[0].any() and not active[1].any()
    for other in (turned, elsewhere):
        apart = np.concatenate([other, *poses[1:]])
        active = active_keys(Session(drives, apart, np.zeros(4, np.int64), Constraints.none()))
        assert active[0].mean() > 0.9


def test_a_drive_is_added_to_the_drawn_map_as_if_all_were_drawn(first: Session) -> None:
    is_kept = ~((PLACE[:, 0] >= 3.0) & (PLACE[:, 2] <= 3.6) & (PLACE[:, 1] >= -1.0) & (PLACE[:, 1] <= -0.6))
    second = continued(first, drive_along(LAP, "thursday", 1000, PLACE[is_kept])).session
    third = continued(second, drive_along(LAP[:HALF], "friday", 2000)).session
    drawn = draw_session(replace(second, poses=third.poses[: len(second.poses)]), 0.05, 100.0).drawn
    whole, added = draw_session(third, 0.05, 100.0), draw_session(replace(third, drawn=drawn), 0.05, 100.0)
    np.testing.assert_array_equal(added.grid.probability, whole.grid.probability)
    np.testing.assert_array_equal(added.layer, whole.layer)
    assert len(added.changes) == len(whole.changes) > 0
    assert drawn.is_valid_for(third.poses + np.array([0.01, 0.0, 0.0]), 0.05)
    assert not drawn.is_valid_for(third.poses + np.array([0.05, 0.0, 0.0]), 0.05)
    assert not drawn.is_valid_for(third.poses, 0.1)
