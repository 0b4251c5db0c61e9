"""session.npz: what is written is read back, and what is damaged is refused with a reason."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.errors import InputError
from gridslam.core.numpy_files import npz_bytes, read_npz
from gridslam.graph.relative_covariance import packed
from gridslam.lidar_slam.sessions import drawn_file, session_file
from gridslam.lidar_slam.sessions.object_records import ObjectRecords
from gridslam.lidar_slam.sessions.session import Session
from gridslam.lidar_slam.sessions.session_file import (
    DIGEST,
    FORMAT,
    VERSION,
    read_session,
    session_bytes,
    with_digest,
)
from gridslam.lidar_slam.sessions.session_map import draw_session
from gridslam.lidar_slam.sessions.stored_scans import POINT_UNIT_M
from tests.lidar_slam.sessions.rings import LAP, drive_along, session_of


@pytest.fixture(scope="module")
def session() -> Session:
    return session_of(drive_along(LAP[:60], "monday.mcap"))


def test_a_session_is_read_back(session: Session) -> None:
    content = session_bytes(session)
    assert content == session_bytes(session)
    read = read_session(content, "session.npz")
    assert read.drives[0].log == "monday.mcap"
    np.testing.assert_array_equal(read.poses, session.poses)
    np.testing.assert_array_equal(read.drives[0].track, session.drives[0].track)
    for one, other in zip(read.scans, session.scans, strict=True):
        assert one.stamp_ns == other.stamp_ns
        np.testing.assert_allclose(one.returns, other.returns, atol=POINT_UNIT_M)
        np.testing.assert_allclose(one.surface_normals, other.surface_normals, atol=1e-4)


def test_a_session_that_was_read_is_written_with_the_same_bytes(session: Session) -> None:
    content = session_bytes(session)
    assert session_bytes(read_session(content, "session.npz")) == content


def test_a_drawn_map_is_read_back_and_a_wrong_one_refused(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = replace(session.drives[0], scans=[replace(s, returns=0.8 * s.returns) for s in session.scans])
    poses = np.concatenate([session.poses] * 2)
    both = replace(session, drives=(session.drives[0], moved), poses=poses, parts=np.zeros(2, np.int64))
    drawn = draw_session(both, 0.05, 100.0).drawn
    whole = replace(both, drawn=drawn)
    content = session_bytes(whole)
    read = read_session(content, "session.npz")
    assert session_bytes(read) == content
    assert read.drawn is not None and drawn.changes
    np.testing.assert_array_equal(read.drawn.log_odds, drawn.log_odds)
    assert [(c.kind, c.x_m, c.length_m) for c in read.drawn.changes] == [
        (c.kind, c.x_m, c.length_m) for c in drawn.changes
    ]
    cell = np.concatenate([change.cells for change in drawn.changes])
    for name, values, reason in (
        ("drawn.known", np.zeros(3, np.uint8), "another size"),
        ("drawn.hits", np.zeros(3, np.uint16), "does not fit the drives"),
        ("drawn.pose", whole.poses[:5], "does not fit the drives"),
        ("change.cell", cell + 10_000, "outside the map"),
        ("change.drive", np.full(len(drawn.changes), 7), "do not fit the drives"),
        ("change.stamps_ns", np.full((len(drawn.changes), 2), -1), "change.stamps_ns is out of range"),
        ("drawn.pose", np.full_like(whole.poses, 1e300), "drawn.pose is out of range"),
    ):
        with pytest.raises(InputError, match=reason):
            read_session(changed(whole, **{name.replace(".", "__"): values}), "session.npz")
    monkeypatch.setattr(session_file, "MAX_DRAWN_CELLS", 1000)
    assert read_session(session_bytes(whole), "session.npz").drawn is None
    monkeypatch.setattr(drawn_file, "MAX_CELLS", 1000)
    with pytest.raises(InputError, match="out of range"):
        read_session(content, "session.npz")


def test_scans_that_are_forged_are_refused_where_they_are_read(session: Session) -> None:
    points = read_npz(io.BytesIO(session_bytes(session)), 1 << 28)["points"]
    read = read_session(changed(session, points=points[::-1]), "session.npz")
    with pytest.raises(InputError, match="scans are damaged"):
        list(read.scans)


def test_estimates_of_objects_are_read_back(session: Session) -> None:
    covariance = np.diag([0.01, 0.02, 0.03])
    objects = ObjectRecords(
        ("door-1", "bin"),
        anchor=np.array([0, 5]),
        poses=np.array([[1.0, 2.0, 0.5], [3.0, 1.0, -0.5]]),
        covariances=np.array([covariance, covariance]),
        stamps_ns=np.array([[10, 20], [30, 40]]),
        reads=np.array([3, 4]),
        gain=np.array([50.0, 60.0]),
        closed_yaw=np.array([0.3, np.nan]),
        gone_ns=np.array([0, 99]),
        is_gone=np.array([False, True]),
    )
    with_objects = replace(session, objects=objects)
    read = read_session(session_bytes(with_objects), "session.npz").objects
    assert read.ids == objects.ids
    for name, values in objects.arrays().items():
        np.testing.assert_array_equal(read.arrays()[name], values)
    with pytest.raises(InputError, match="an object without a key scan"):
        read_session(changed(with_objects, object__anchor=np.array([0, 10_000])), "session.npz")
    with pytest.raises(InputError, match=r"object\.pose is out of range"):
        read_session(changed(with_objects, object__pose=np.full((2, 3), 1e300)), "session.npz")
    with pytest.raises(InputError, match="objects do not fit"):
        read_session(changed(with_objects, object__reads=np.array([3])), "session.npz")


def test_a_robot_that_sways_has_a_path_without_its_sway_also_after_reading(session: Session) -> None:
    (drive,) = session.drives
    swing = np.column_stack([0.05 * np.sin(np.arange(len(drive.track))), np.zeros(len(drive.track))])
    level = replace(drive, log="thursday.mcap")
    both = replace(
        session,
        drives=(replace(drive, swing_m=swing), level),
        poses=np.concatenate([session.poses] * 2),
        parts=np.zeros(2, np.int64),
    )
    content = session_bytes(both)
    read = read_session(content, "session.npz")
    assert session_bytes(read) == content
    robot = read.trajectory(0).poses
    np.testing.assert_allclose(se2.compose(robot, np.pad(swing, ((0, 0), (0, 1)))), session.poses, atol=1e-9)
    np.testing.assert_allclose(read.trajectory(1).poses, session.poses, atol=1e-9)
    with pytest.raises(InputError, match=r"scan\.swing is out of range"):
        read_session(changed(both, scan__swing=np.full((2 * len(swing), 2), 5.0)), "session.npz")
    with pytest.raises(InputError, match="do not fit"):
        read_session(changed(both, scan__swing=swing), "session.npz")


def changed(session: Session, **arrays: object) -> bytes:
    """The session's file with other values for some arrays, and the right digest; None leaves one out."""
    content = {
        **read_npz(io.BytesIO(session_bytes(session)), 1 << 28),
        **{k.replace("__", "."): v for k, v in arrays.items()},
    }
    del content[DIGEST]
    return npz_bytes(with_digest((name, np.asarray(v)) for name, v in content.items() if v is not None))


def test_a_change_of_numbers_in_their_range_is_noticed(session: Session) -> None:
    arrays = read_npz(io.BytesIO(session_bytes(session)), 1 << 28)
    for name in ("key.pose", "scan.track", "visits.motion", "points", "drive.range_m"):
        altered = {**arrays, name: arrays[name][::-1]}
        if name == "drive.range_m":
            altered[name] = arrays[name] + 0.5
        with pytest.raises(InputError, match="its content was changed after it was written"):
            read_session(npz_bytes(altered.items()), "session.npz")
    reordered = npz_bytes(sorted(arrays.items()))
    assert session_bytes(read_session(reordered, "session.npz")) == session_bytes(session)


def test_wrong_content_is_refused_with_its_reason(session: Session) -> None:
    head = np.frombuffer(b'{"format": "gridslam session", "version": 99, "logs": ["a"]}', np.uint8)
    half = f'{{"format": "{FORMAT}", "version": {VERSION}, "logs": ["\\ud800"], "objects": []}}'.encode()
    poses = session.poses.copy()
    poses[3, 0] = np.nan
    keys = session.drives[0].keys.copy()
    keys[5] = 10_000
    edges = packed(session.constraints.visits.information)
    for content, reason in (
        (changed(session, head=head), "version 99"),
        (changed(session, head=np.frombuffer(half, np.uint8)), "no names that can be written"),
        (changed(session, head=None), "no readable head"),
        (changed(session, head=np.ones(9, np.complex128)), "no readable head"),
        (changed(session, points=None), "points is missing"),
        (changed(session, key__pose=poses), "not finite"),
        (changed(session, key__pose=session.poses[:-1]), "do not fit"),
        (changed(session, key__viewpoint=np.full((len(keys), 2), 1e300)), "key.viewpoint is out of range"),
        (changed(session, key__pose=np.full((len(keys), 3), 1e7)), "key.pose is out of range"),
        (changed(session, drive__range_m=np.array([1e300])), "drive.range_m is out of range"),
        (
            changed(session, scan__stamp_ns=session.drives[0].stamps_ns - 2**62),
            "scan.stamp_ns is out of range",
        ),
        (changed(session, drive__range_m=np.array([-1.0])), "drive.range_m is out of range"),
        (changed(session, drive__part=np.array([-1])), "drive.part is out of range"),
        (changed(session, drive__part=np.array(0)), "drive.part is missing or of another form"),
        (changed(session, visits__information=np.full_like(edges, 1e300)), "an information is out of range"),
        (changed(session, key__scan=keys), "none of its drive's scans"),
        (changed(session, key__returns=-np.ones(len(keys), np.int64)), "out of range"),
        (changed(session, points=np.zeros(9, np.uint8)), "do not fit"),
        (changed(session, key__returns=np.full(len(keys), 2**30)), "claims to hold"),
        (session_bytes(session)[:-200], "damaged"),
        (b"image: map.pgm", "not a session; give the session.npz of a run"),
    ):
        with pytest.raises(InputError, match=reason):
            read_session(content, "session.npz")


def test_objects_and_bombs_are_refused(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, head=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="damaged"):
        read_session(buffer.getvalue(), "session.npz")
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("head.npy", bytes(2 << 20))
    monkeypatch.setattr(session_file, "MIN_KEY_BYTES", 1 << 20)
    with pytest.raises(InputError, match=r"it claims to hold \d+ key scans in"):
        read_session(session_bytes(session), "session.npz")
    monkeypatch.setattr(session_file, "MAX_UNPACKED_BYTES", 1 << 20)
    with pytest.raises(InputError, match="its arrays take 2097152 bytes; the limit is 1048576"):
        read_session(buffer.getvalue(), "session.npz")


def test_altered_bytes_never_end_in_another_error(session: Session) -> None:
    content = bytearray(session_bytes(session))
    rng = np.random.default_rng(0)
    for _ in range(60):
        altered = content.copy()
        for at in rng.integers(0, len(altered), 3):
            altered[at] = rng.integers(0, 256)
        try:
            read_session(bytes(altered), "session.npz")
        except InputError as error:
            assert "session.npz" in str(error)
