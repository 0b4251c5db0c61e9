"""A simulated log as files: the log itself, and the ground truth in `NAME.truth/`."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from gridslam.core.errors import ConfigError
from gridslam.core.files import (
    check_has_name,
    identity_of,
    partial_folder,
    put_folder,
    refuse_if_made_since,
    remove,
    write_atomic,
)
from gridslam.core.messages import Odometry
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import format_stamp
from gridslam.logs.write import open_writer
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.simulation.driving.robot_config import route_length_m
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.geometry import radians
from gridslam.simulation.scene import Scene
from gridslam.simulation.shapes import Door
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.tag_database import tag_database_yaml
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.work import refuse_long
from gridslam.simulation.world_config import WorldConfig

UNFINISHED = ".unfinished"  # a file in a truth folder whose log may not exist yet
TRUTH_FILES = frozenset(
    ("trajectory.tum", "map.pgm", "map.yaml", "objects.csv", "tags.yaml", "world.yaml", UNFINISHED)
)
MIN_OPEN_DEG = 5.0  # a door opened less is recorded as closed


@dataclass(frozen=True, slots=True)
class Recorded:
    """Summary of a recording: number of messages by kind, simulated time, distance driven, folder of the ground truth."""

    messages: dict[str, int]
    duration_s: float
    distance_m: float
    truth: Path


def truth_folder(log: Path) -> Path:
    """`NAME.truth` beside `NAME.mcap` or the folder `NAME`."""
    return log.with_name(f"{log.name.removesuffix('.mcap')}.truth")


def check_truth_free(log: Path, force: bool) -> None:
    """Raise ConfigError unless the truth of a log may be written: nothing is there, or what a killed process has left, or with
    `force` an earlier truth.
    """
    folder = truth_folder(log)
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not folder.is_dir() or not {entry.name for entry in folder.iterdir()} <= TRUTH_FILES:
        raise ConfigError(
            f"{folder}: exists and is not ground truth, so it is never replaced; choose another name"
        )
    is_left_over = (folder / UNFINISHED).exists() and not log.exists()
    if not force and not is_left_over:
        raise ConfigError(f"{folder}: exists; choose another name or use --force")


def record_world(
    world: WorldConfig,
    folder: Path,
    output: Path,
    force: bool = False,
    report: Callable[[float], None] = lambda fraction: None,
) -> Recorded:
    """Drive the route and write log and ground truth.

    Both appear together: a log never is without its truth. `report` is called ten times per simulated second with the
    fraction of the route that has been driven. Raises ConfigError: one of them is there already, and `force` is not given or
    it is something else; or the drive is too much work.
    """
    check_has_name(output)
    refuse_long(world)
    truth = truth_folder(output)
    log_before, truth_before = identity_of(output), identity_of(truth)
    simulator = Simulator(world, folder)
    grid = true_map(simulator.scene, world.truth)  # first, since it may raise an error
    counts: Counter[str] = Counter()
    length_m = route_length_m(world.robot)
    path: list[Odometry] = []
    with open_writer(output, force) as writer:
        check_truth_free(output, force)
        for event, is_truth in drive_route(simulator):
            if is_truth and isinstance(event, Odometry):
                writer.write_truth(event)
                path.append(event)
                report(min(simulator.robot.distance_m / max(length_m, 1e-9), 1.0))
            else:
                writer.write(event)
                counts[type(event).__name__] += 1
        writer.complete()  # a full disk is noticed before anything is replaced
        with partial_folder(truth) as folder_of_truth:
            write_truth(folder_of_truth, world, simulator.scene, path, grid)
            (folder_of_truth / UNFINISHED).touch()
            if force:
                refuse_if_made_since(output, log_before)
                remove(output)
            put_folder(folder_of_truth, truth, truth_before)
        try:
            writer.close()
        except BaseException:  # another process has put a log there
            remove(truth)
            raise
    (truth / UNFINISHED).unlink(missing_ok=True)  # the log has its name now
    return Recorded(dict(sorted(counts.items())), simulator.time_s, simulator.robot.distance_m, truth)


def write_truth(
    folder: Path, world: WorldConfig, scene: Scene, path: list[Odometry], grid: OccupancyGrid
) -> None:
    """Write the true trajectory, map and objects, the world, and the tag database if an object has a tag."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / "trajectory.tum", "".join(map(tum_line, path)).encode())
    save_map(grid, folder / "map")
    write_atomic(folder / "objects.csv", objects_csv(world, scene).encode())
    if any(obj.tag for obj in world.movable_objects):
        write_atomic(folder / "tags.yaml", tag_database_yaml(world).encode())
    document = world.model_dump(mode="json", exclude_defaults=True)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)
    write_atomic(folder / "world.yaml", text.encode())


def tum_line(pose: Odometry) -> str:
    """A pose as a line of a TUM file."""
    qw, _, _, qz = quaternion_of_yaw(pose.yaw_rad).tolist()
    return f"{format_stamp(pose.stamp_ns)} {pose.x_m:.6f} {pose.y_m:.6f} 0 0 0 {qz:.9f} {qw:.9f}\n"


def objects_csv(world: WorldConfig, scene: Scene) -> str:
    """CSV text of doors (pose of the hinge, x along the leaf) and objects (pose of the centre) at the end of the log."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["id", "class", "x", "y", "yaw", "moved", "state", "tag", "length", "width"])
    for obj in world.movable_objects:
        pose = scene.pose_of(obj)
        if isinstance(obj, Door):
            opening = scene.openings[obj.id]
            first, size = obj.opening_deg, (obj.width_m, obj.thickness_m)
            state, moved = ("open" if abs(opening) > MIN_OPEN_DEG else "closed"), opening != first
        else:
            state, size = "", obj.size
            moved = bool(np.abs(pose - radians(obj.pose)).max() > 1e-9)
        numbers = [f"{value:.6f}" for value in pose.tolist()]
        tag = obj.tag.id if obj.tag else ""
        writer.writerow([obj.id, obj.kind, *numbers, str(moved).lower(), state, tag, *size])
    return text.getvalue()
