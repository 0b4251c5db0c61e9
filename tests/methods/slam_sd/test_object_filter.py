"""The filter over one object's pose, on simulated scans of a wall with a niche."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.tag_database import TagDatabase
from gridslam.methods.slam_sd.objects.joint_estimation import LocatedObject, VisitedObject, locate_jointly
from gridslam.methods.slam_sd.objects.object_config import ObjectEvidenceConfig, ObjectsConfig
from gridslam.methods.slam_sd.objects.object_filter import LIDAR_WEIGHT, ObjectFilter, ObjectPosterior
from gridslam.methods.slam_sd.objects.object_model import ObjectModel, object_models
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.pose_prior import PriorEstimate
from gridslam.methods.slam_sd.objects.visit_evidence import (
    InventoryRound,
    KeyScanObservation,
    VisitEvidence,
    gather_evidence,
)

SECOND = 1_000_000_000
SETTINGS = ObjectSettings(ObjectsConfig(particles=500), ObjectEvidenceConfig())
BIN_POSE = np.array([0.0, 1.28, -np.pi / 2])  # its back to the wall at y = 1.5, its tag towards the robot
DOOR_POSE = np.array([0.4, 1.5, 0.0])  # closed, right beside the bin
BOX = [[-0.2, -0.25], [0.2, -0.25], [0.2, 0.25], [-0.2, 0.25]]
LEAF = [[0, -0.02], [0.6, -0.02], [0.6, 0.02], [0, 0.02]]


def bin_and_door() -> tuple[ObjectModel, ObjectModel]:
    """A bin and a small door."""
    front = {"id": "tag-bin", "position": [0.2, 0.0], "facing_deg": 0.0}
    leaf = {"id": "tag-door", "position": [0.3, -0.02], "facing_deg": -90.0}
    objects = [
        {"id": "bin", "class": "bin", "footprint": BOX, "tags": [front]},
        {"id": "door", "class": "door", "footprint": LEAF, "tags": [leaf], "hinge": [0.0, 0.0]},
    ]
    box, door = object_models(TagDatabase.model_validate({"objects": objects}))
    return box, door


def segments_of(corners: np.ndarray) -> np.ndarray:
    return np.column_stack([corners, np.roll(corners, -1, axis=0)])


def scan_at(pose: np.ndarray, segments: np.ndarray, rng: np.random.Generator) -> PreparedScan:
    """A scan of 181 beams towards positive y, with Laplacian noise."""
    angles = np.linspace(0.0, np.pi, 181)
    dx, dy = np.cos(angles + pose[2])[:, None], np.sin(angles + pose[2])[:, None]
    ax, ay = segments[:, 0] - pose[0], segments[:, 1] - pose[1]
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        along, across = (ax * ey - ay * ex) / cross, (ax * dy - ay * dx) / cross
        hit = (along > 0.0) & (across >= 0.0) & (across <= 1.0)
    ranges = np.where(hit, along, np.inf).min(axis=1) + rng.laplace(0.0, 0.006, len(angles))
    seen = np.isfinite(ranges)
    points = ranges[seen, None] * np.column_stack([np.cos(angles[seen]), np.sin(angles[seen])])
    none = np.zeros((0, 2))
    return PreparedScan(0, np.zeros(2), points, none, none, none, none)


def evidence_of(model: ObjectModel, standing: dict[str, np.ndarray], seed: int = 0) -> VisitEvidence:
    """A drive along the wall; each tag is read within a metre of its place."""
    rng = np.random.default_rng(seed)
    pieces = [np.array([[-4.0, 1.5, 0.4, 1.5], [1.0, 1.5, 4.0, 1.5], [-4.0, -1.5, 4.0, -1.5]])]
    by_id = {t.id: t for t in bin_and_door()}
    pieces += [segments_of(by_id[name].corners_at(pose)) for name, pose in standing.items()]
    segments = np.concatenate(pieces)
    scans, rounds = [], []
    for k, x in enumerate(np.arange(-1.5, 1.6, 0.25)):
        pose = np.array([x, 0.0, 0.0])
        scans.append(KeyScanObservation(k, k * SECOND // 2, pose, scan_at(pose, segments, rng)))
    for k, x in enumerate(np.arange(-1.5, 1.6, 0.06)):
        antenna = np.array([x, 0.0, np.pi / 2])
        near = [
            tag
            for name, pose in standing.items()
            for tag, own in zip(by_id[name].tag_ids, by_id[name].tags, strict=True)
            if abs(se2.compose(pose, own)[0] - x) < 0.8 and rng.random() < 0.9
        ]
        rounds.append(InventoryRound(k * SECOND // 8, antenna, tuple(near)))
    return gather_evidence(model, scans, rounds, np.array([0.0, 1.0]))


def error(found: ObjectPosterior, pose: np.ndarray) -> np.ndarray:
    return se2.between(pose, found.pose)


def test_a_box_is_found_to_a_centimetre_with_a_small_covariance() -> None:
    box, _ = bin_and_door()
    evidence = evidence_of(box, {"bin": BIN_POSE, "door": DOOR_POSE})
    found = ObjectFilter(box, evidence, None, SETTINGS).locate(np.random.default_rng(1))
    off = error(found, BIN_POSE)
    assert np.hypot(off[0], off[1]) < 0.02
    assert abs(off[2]) < 0.05
    assert np.sqrt(np.diag(found.covariance))[:2].max() < 0.02
    assert LIDAR_WEIGHT * found.gain > SETTINGS.evidence.min_log_likelihood_ratio
    assert found.poses.shape == (SETTINGS.objects.particles, 3)


def test_a_closed_door_is_found_flush_in_its_wall() -> None:
    _, door = bin_and_door()
    evidence = evidence_of(door, {"door": DOOR_POSE})
    found = ObjectFilter(door, evidence, None, SETTINGS).locate(np.random.default_rng(1))
    off = error(found, DOOR_POSE)
    assert abs(off[0]) < 0.1
    assert abs(off[1]) < 0.03
    assert abs(off[2]) < 0.1


def test_an_open_door_is_found_without_reads_when_its_hinge_is_known() -> None:
    _, door = bin_and_door()
    opened = np.array([0.4, 1.5, np.radians(70.0)])
    evidence = evidence_of(door, {"door": opened})
    silent = replace(evidence, reads=np.zeros_like(evidence.reads))
    earlier = PriorEstimate(DOOR_POSE, np.diag([0.05, 0.05, 0.05]) ** 2, is_certain=True)
    found = ObjectFilter(door, silent, earlier, SETTINGS).locate(np.random.default_rng(2))
    assert abs(np.degrees(error(found, opened)[2])) < 6.0


def test_the_earlier_estimate_helps_and_does_not_hold_back_a_moved_object() -> None:
    box, _ = bin_and_door()
    evidence = evidence_of(box, {"bin": BIN_POSE})
    covariance = np.diag([0.05, 0.05, 0.03]) ** 2
    here = PriorEstimate(BIN_POSE, covariance)
    same = ObjectFilter(box, evidence, here, SETTINGS).locate(np.random.default_rng(3))
    elsewhere = PriorEstimate(BIN_POSE + np.array([0.9, 0.0, 0.0]), covariance)
    moved = ObjectFilter(box, evidence, elsewhere, SETTINGS).locate(np.random.default_rng(3))
    for found in (same, moved):
        assert np.hypot(*error(found, BIN_POSE)[:2]) < 0.02


def test_the_gain_is_low_if_the_lidar_does_not_see_the_object() -> None:
    box, _ = bin_and_door()
    seen = evidence_of(box, {"bin": BIN_POSE})
    bare = evidence_of(box, {})
    unseen = VisitEvidence(seen.rounds, seen.reads, bare.beams, bare.walls)
    found = ObjectFilter(box, unseen, None, SETTINGS).locate(np.random.default_rng(4))
    assert LIDAR_WEIGHT * found.gain < SETTINGS.evidence.min_log_likelihood_ratio


def test_a_door_beside_a_bin_is_not_reported_on_the_bin() -> None:
    box, door = bin_and_door()
    standing = {"bin": BIN_POSE, "door": DOOR_POSE}
    of_box, of_door = (VisitedObject(m, evidence_of(m, standing), None) for m in (box, door))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        first = of_box.filter((), SETTINGS).locate(rng)
        beside, _ = locate_jointly(of_door, {"bin": LocatedObject(of_box, first)}, (), SETTINGS, rng)
        assert abs(error(beside, DOOR_POSE)[0]) < 0.12
        assert abs(error(beside, DOOR_POSE)[2]) < 0.15


def test_an_object_that_was_located_at_anothers_place_is_located_again() -> None:
    box, door = bin_and_door()
    standing = {"bin": BIN_POSE, "door": DOOR_POSE}
    of_box, of_door = (VisitedObject(m, evidence_of(m, standing), None) for m in (box, door))
    rng = np.random.default_rng(7)
    on_the_bin = np.array([-0.3, 1.1, 0.0])  # the leaf lies along the front of the bin
    wrong = of_door.filter((), SETTINGS)
    claimed = ObjectPosterior(
        on_the_bin,
        1e-4 * np.eye(3),
        on_the_bin[None],
        wrong.log_likelihood_ratio(on_the_bin),
        wrong.log_posterior(on_the_bin),
    )
    found, moved = locate_jointly(of_box, {"door": LocatedObject(of_door, claimed)}, (), SETTINGS, rng)
    assert np.hypot(*error(found, BIN_POSE)[:2]) < 0.03
    assert np.hypot(*error(moved["door"], DOOR_POSE)[:2]) < 0.15
