"""Tagged objects in slam-sd on the sample log: a corridor with two doors and two bins, some of which are moved."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event, TagInventory
from gridslam.evaluation.readers.object_files import read_objects
from gridslam.logs.config import LogConfig
from gridslam.logs.open import open_log
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.maps.tag_database import ObjectTag, TagDatabase, load_tag_database
from gridslam.methods.base import RunResult
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import SlamSd
from gridslam.methods.slam_sd.objects.object_config import ObjectsConfig

SAMPLE = Path(__file__).resolve().parents[3] / "sample_logs" / "slam-sd-tags.mcap"
TRUTH = SAMPLE.with_suffix(".truth")
CONFIG = SlamSdConfig(particles=4)
START = np.array([1.0, 1.5, 0.0])  # where the robot begins in the world: the origin of the map


@pytest.fixture(scope="module")
def events() -> list[Event]:
    with open_log(SAMPLE, LogConfig(), ("scan", "odom", "tags")) as log:
        return list(log.events())


@pytest.fixture(scope="module")
def database() -> TagDatabase:
    return load_tag_database(TRUTH / "tags.yaml")


def run(events: Iterable[Event], database: TagDatabase | None, config: SlamSdConfig = CONFIG) -> RunResult:
    method = SlamSd(config, 1, database)
    for event in events:
        method.process(event)
    return method.result()


@pytest.fixture(scope="module")
def finished(events: list[Event], database: TagDatabase) -> RunResult:
    return run(events, database)


def table_rows(result: RunResult, name: str = "objects") -> list[dict[str, str]]:
    table = result.tables[name]
    return [{k: str(v) for k, v in zip(table.columns, row, strict=True)} for row in table.rows]


def assert_all_right(result: RunResult) -> None:
    truth = read_objects(TRUTH / "objects.csv")
    found = {row["id"]: row for row in table_rows(result)}
    assert found.keys() == truth.keys()
    for name, true in truth.items():
        row = found[name]
        here = se2.compose(START, np.array([float(row[k]) for k in ("x", "y", "yaw")]))
        error = se2.between(np.array(true.pose), here)
        assert np.hypot(error[0], error[1]) < 0.15, name
        assert abs(np.degrees(error[2])) < 15.0, name
        assert (row["class"], row["moved"], row["state"] or None) == (
            true.category, str(true.moved).lower(), true.state,
        )  # fmt: skip


def test_all_objects_have_the_right_pose_state_and_moved_flag(finished: RunResult) -> None:
    assert_all_right(finished)


def test_errors_agree_with_the_covariance(finished: RunResult) -> None:
    truth = read_objects(TRUTH / "objects.csv")
    for row in table_rows(finished):
        here = se2.compose(START, np.array([float(row[k]) for k in ("x", "y", "yaw")]))
        error = se2.between(here, np.array(truth[row["id"]].pose))
        std = np.sqrt([float(row["var_x"]), float(row["var_y"]), float(row["var_yaw"])])
        rotated = se2.transform_points(np.array([0.0, 0.0, here[2]]), error[None, :2])[0]
        slack = np.array([0.02, 0.02, 0.01])  # of the map about the object
        assert (np.abs([*rotated, error[2]]) < 4.0 * std + slack).all(), row["id"]


def test_the_history_has_a_row_per_visit_in_order(finished: RunResult) -> None:
    history = table_rows(finished, "objects_history")
    stamps = [float(row["stamp"]) for row in history]
    assert stamps == sorted(stamps)
    states = [row["state"] for row in history if row["id"] == "door-1"]
    assert states[0] == "closed"
    assert states[-1] == "open"
    assert [row["moved"] for row in history if row["id"] == "bin-1"].count("true") == 1


def test_objects_are_in_the_composed_map_only_and_leave_no_trace_in_the_static_map(
    finished: RunResult,
) -> None:
    static, composed = finished.maps["static"], finished.maps["composed"]
    assert finished.occupancy is composed

    def occupied(grid: OccupancyGrid, x: float, y: float) -> float:
        world = np.array([[x + dx, y + dy] for dx in (-0.15, 0.0, 0.15) for dy in (-0.1, 0.0, 0.1)])
        row, col = grid.geometry.cells(se2.transform_points(se2.inverse(START), world)).T
        return float((np.nan_to_num(grid.probability[row, col]) > 0.65).mean())

    assert occupied(static, 2.2, 0.22) == 0.0  # where bin-1 stood first
    assert occupied(composed, 2.2, 0.22) == 0.0
    assert occupied(static, 4.6, 0.22) == 0.0  # where it stands now
    assert occupied(composed, 4.6, 0.22) == 1.0


BLUE, RED = (30, 110, 200), (205, 45, 45)
MIDDLES = {"large-door": (0.45, 0.0), "bin": (0.0, 0.0)}  # in the objects' own frames


def test_objects_are_drawn_at_their_poses_and_moved_ones_are_red(finished: RunResult) -> None:
    static, picture = finished.maps["static"], finished.pictures["objects"].rgb.astype(float)
    plain = np.asarray(render_map(static, finished.trajectory)).astype(float)
    moved = []
    for row in table_rows(finished):
        pose = np.array([float(row[k]) for k in ("x", "y", "yaw")])
        middle = se2.transform_points(pose, np.array([MIDDLES[row["class"]]]))
        dotted = np.asarray(render_map(static, finished.trajectory, points=middle)).astype(float)
        y, x = np.argwhere((dotted != plain).any(axis=2)).mean(axis=0).round().astype(int)
        colour = np.array(RED if row["moved"] == "true" else BLUE)
        off, off_without = np.abs(picture[y, x] - colour).max(), np.abs(plain[y, x] - colour).max()
        assert off_without > 50, row["id"]
        assert off < 0.5 * off_without + 3, row["id"]  # half of what lies under an object shines through
        moved.append(row["moved"])
    assert sorted(moved) == ["false", "true", "true", "true"]


def silent(events: Iterable[Event]) -> Iterator[Event]:
    for event in events:
        yield replace(event, tag_ids=(), rssi_dbm=()) if isinstance(event, TagInventory) else event


def test_without_reads_the_lidar_slam_gives_the_same_bytes(
    events: list[Event], database: TagDatabase
) -> None:
    plain = run((e for e in events if not isinstance(e, TagInventory)), None)
    for other in (run(silent(events), database), run(events, None)):
        assert other.trajectory.poses.tobytes() == plain.trajectory.poses.tobytes()
        assert plain.occupancy is not None
        assert other.occupancy is not None
        assert other.occupancy.probability.tobytes() == plain.occupancy.probability.tobytes()
        assert not other.maps
        assert not other.tables


def test_reads_without_a_database_are_counted(events: list[Event]) -> None:
    rounds = [e for e in events if isinstance(e, TagInventory)]
    result = run([e for e in events[:200] if not isinstance(e, TagInventory)] + rounds[:5], None)
    assert result.counters["skipped.tags.no_database"] == 5


def disturbed(events: Iterable[Event]) -> Iterator[Event]:
    """Rounds with false reads, unknown ids, a tag on an object outside the scan plane, and a second tag on bin-2."""
    rounds = 0
    for event in events:
        if isinstance(event, TagInventory):
            ids = list(event.tag_ids)
            rounds += 1
            if rounds % 50 == 0:
                ids.append("somebody-else")
            if rounds % 199 == 0:
                ids.append("tag-false_read")
            if 40 <= rounds < 60:
                ids.append("tag-hanging")
            if "tag-bin-2" in ids:
                ids.append("tag-bin-2-back")
            event = replace(event, tag_ids=tuple(ids), rssi_dbm=(-50.0,) * len(ids))
        yield event


def test_false_reads_put_no_object_into_the_map(events: list[Event], database: TagDatabase) -> None:
    box = next(entry for entry in database.objects if entry.id == "bin-2")
    second = ObjectTag(id="tag-bin-2-back", position=(0.2, 0.1))
    others = [entry for entry in database.objects if entry.id != "bin-2"]
    hanging, false_read = (
        box.model_copy(update={"id": name, "tags": (ObjectTag(id=f"tag-{name}", position=(0.2, 0.0)),)})
        for name in ("hanging", "false_read")
    )
    both = box.model_copy(update={"tags": (*box.tags, second)})
    result = run(disturbed(events), TagDatabase(objects=(*others, both, hanging, false_read)))
    assert_all_right(result)
    rounds = sum(isinstance(e, TagInventory) for e in events)
    assert result.counters["tags.unknown_id"] == rounds // 50
    assert result.counters["tags.false_reads"] >= rounds // 199
    assert result.counters["objects.not_in_scan_plane"] >= 1


def test_a_box_that_is_neither_read_nor_seen_at_its_place_is_gone(
    events: list[Event], database: TagDatabase
) -> None:
    first_ns = events[0].stamp_ns

    def unread(event: Event) -> Event:
        if not isinstance(event, TagInventory) or event.stamp_ns < first_ns + 15 * 10**9:
            return event
        kept = tuple(tag for tag in event.tag_ids if tag != "tag-bin-1")
        return replace(event, tag_ids=kept, rssi_dbm=(-50.0,) * len(kept))

    result = run(map(unread, events), database)
    row = next(row for row in table_rows(result) if row["id"] == "bin-1")
    assert (row["present"], row["moved"]) == ("false", "true")
    assert result.counters["objects.gone"] == 1
    place = se2.transform_points(se2.inverse(START), np.array([[2.2, 0.22]]))
    composed = result.maps["composed"]
    at_row, at_col = composed.geometry.cells(place)[0]
    assert composed.probability[at_row, at_col] < 0.5


def test_rounds_without_extrinsics_or_pose_are_counted(events: list[Event], database: TagDatabase) -> None:
    few = [e for e in events[:400] if not isinstance(e, TagInventory)]
    rounds = [e for e in events[:400] if isinstance(e, TagInventory)]
    lost = [replace(rounds[0], stamp_ns=rounds[0].stamp_ns - 10**10)]
    strange = [replace(rounds[5], frame_id="nowhere"), replace(rounds[5], stamp_ns=2**62)]
    counters = run(few[:8] + lost + strange + few[8:] + rounds[5:6], database).counters
    assert counters["skipped.tags.no_extrinsics"] == 1
    assert counters["skipped.tags.no_scan"] >= 2


def test_two_databases_are_refused(database: TagDatabase) -> None:
    with pytest.raises(ConfigError, match=r"method\.objects\.database"):
        SlamSd(SlamSdConfig(objects=ObjectsConfig(database=database)), 0, database)


def test_the_same_seed_gives_the_same_objects(
    events: list[Event], database: TagDatabase, finished: RunResult
) -> None:
    again = run(events, database)
    assert again.tables["objects"].rows == finished.tables["objects"].rows
