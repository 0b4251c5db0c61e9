"""Histories of tagged objects go on from drive to drive."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.methods.slam_sd.objects.object_config import ObjectEvidenceConfig, ObjectsConfig
from gridslam.methods.slam_sd.objects.object_history import ObjectHistory
from gridslam.methods.slam_sd.objects.object_records import estimates_in, records_of
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.object_tracker import ObjectTracker
from tests.methods.slam_sd.test_object_parts import SECOND, episode, model_of

FIRST_DRIVE = [np.array([0.0, 0.0, 0.0]), np.array([5.0, 0.0, 0.0])]
SECOND_DRIVE = [np.array([6.0, 1.0, np.pi / 2])]


def continued(second_at: tuple[float, float, float]) -> tuple[ObjectHistory, ObjectRecords]:
    """The history after two drives, the second of which found the object at a pose in the map; and its records."""
    earlier = records_of([ObjectHistory(model_of(), estimates=[episode(1, (1.0, 0.0, 0.0), first_s=100)])])
    settings = ObjectSettings(ObjectsConfig(), ObjectEvidenceConfig())
    tracker = ObjectTracker([model_of()], settings, np.random.default_rng(0))
    x, y, yaw = se2.between(SECOND_DRIVE[0], np.array(second_at)).tolist()
    tracker.objects["a"].estimates = [episode(0, (x, y, yaw), first_s=3)]  # by another clock
    path = np.array([*FIRST_DRIVE, *SECOND_DRIVE])
    tracker.continue_histories(earlier, len(FIRST_DRIVE), path)
    return tracker.objects["a"], records_of(tracker.objects.values())


def test_an_object_that_stands_where_an_earlier_drive_found_it_has_not_moved() -> None:
    history, records = continued((6.01, 0.0, 0.0))
    assert not history.has_moved
    assert [e.reads for e in history.episodes] == [10]
    assert history.episodes[0].first_ns == 100 * SECOND
    assert records.anchor.tolist() == [1, 2]


def test_an_object_that_was_moved_between_the_drives_has_an_episode_in_each() -> None:
    history, _ = continued((7.5, 0.0, 0.0))
    assert history.has_moved
    poses = [e.pose_in_map(np.array([*FIRST_DRIVE, *SECOND_DRIVE])) for e in history.episodes]
    np.testing.assert_allclose(poses, [(6.0, 0.0, 0.0), (7.5, 0.0, 0.0)], atol=1e-9)


def test_estimates_are_the_same_after_a_session_has_kept_them() -> None:
    gone = ObjectHistory(model_of(), estimates=[episode(1, (1.0, 2.0, 0.5), first_s=7)])
    records = ObjectRecords.concatenate([ObjectRecords.none(), records_of([gone])])
    (read,) = estimates_in(records)["a"]
    np.testing.assert_array_equal(read.pose, (1.0, 2.0, 0.5))
    assert (read.closed_yaw, read.gone_ns, read.reads) == (None, None, 5)
    assert records.select([False]).ids == ()
