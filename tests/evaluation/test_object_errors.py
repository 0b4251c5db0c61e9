from __future__ import annotations

import numpy as np
import pytest

from gridslam.evaluation.object_errors import MapObject, object_errors

TRUTH = {
    "bin": MapObject((1.0, 2.0, 0.5), "box", moved=True),
    "door": MapObject((5.0, 0.0, 0.0), "door", moved=False, state="open"),
    "far": MapObject((9.0, 9.0, 0.0), "box", moved=False),
}


def test_objects_are_matched_by_id_and_judged() -> None:
    found = {
        "bin": MapObject((1.0, 2.3, 0.6), "box", moved=True),
        "door": MapObject((5.0, 0.0, 0.0), "door", moved=False, state="closed"),
        "ghost": MapObject((0.0, 0.0, 0.0), "box"),
    }
    errors = object_errors(found, TRUTH, np.zeros(3))
    assert (errors.count, errors.found, errors.correct, errors.extra) == (3, 2, 1, 1)
    assert errors.position_m == pytest.approx([0.3, 0.0])
    assert errors.heading_deg == pytest.approx([np.rad2deg(0.1), 0.0])
    assert (errors.doors, errors.doors_state_correct) == (1, 0)


def test_an_object_too_far_away_is_found_but_not_correct() -> None:
    found = {"far": MapObject((9.0, 9.6, 0.0), "box", moved=False)}
    assert object_errors(found, TRUTH, np.zeros(3)).correct == 0
    assert object_errors(found, TRUTH, np.zeros(3), max_position_m=0.7).correct == 1


def test_found_objects_are_moved_into_the_frame_of_the_truth() -> None:
    found = {"far": MapObject((9.0, -9.0, -np.pi / 2), "box", moved=False)}
    assert object_errors(found, TRUTH, np.array([0.0, 0.0, np.pi / 2])).correct == 1


def test_nothing_found_has_no_position_errors() -> None:
    errors = object_errors({}, TRUTH, np.zeros(3))
    assert (errors.found, errors.correct, len(errors.position_m)) == (0, 0, 0)
