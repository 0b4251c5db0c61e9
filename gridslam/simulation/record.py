"""A simulated log as files: the log itself, and `NAME.truth/` with what a method has to find out."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from gridslam.core.files import write_atomic
from gridslam.core.messages import Odometry
from gridslam.core.poses import quaternion_of_yaw
from gridslam.core.stamps import format_stamp
from gridslam.logs.write import open_writer
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.simulation.outlines import radians
from gridslam.simulation.route import drive_route, route_length_m
from gridslam.simulation.scene import Scene
from gridslam.simulation.shapes import Door
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.tag_database import tag_database_yaml
from gridslam.simulation.truth_map import true_map
from gridslam.simulation.world_config import World

OPEN_FROM_DEG = 5.0


@dataclass(frozen=True, slots=True)
class Recorded:
    """What was written: messages by kind, seconds of simulated time, metres driven."""

    messages: dict[str, int]
    duration_s: float
    way_m: float
    truth: Path


def truth_folder(log: Path) -> Path:
    """`NAME.truth` beside `NAME.mcap` or the folder `NAME`."""
    return log.with_name(f"{log.name.removesuffix('.mcap')}.truth")


def record_world(
    world: World,
    folder: Path,
    output: Path,
    force: bool = False,
    tell: Callable[[float], None] = lambda share: None,
) -> Recorded:
    """Drive the route and write log and truth; `tell` is called now and then with the share of the route that is behind."""
    simulator = Simulator(world, folder)
    grid = true_map(simulator.scene, world.truth)  # first: it may say that the world is too large
    counts: Counter[str] = Counter()
    length_m = route_length_m(world.robot)
    path: list[Odometry] = []
    with open_writer(output, force) as writer:
        for event, is_truth in drive_route(simulator):
            if is_truth and isinstance(event, Odometry):
                writer.write_truth(event)
                path.append(event)
                tell(min(simulator.robot.way_m / max(length_m, 1e-9), 1.0))
            else:
                writer.write(event)
                counts[type(event).__name__] += 1
    truth = truth_folder(output)
    write_truth(truth, world, simulator.scene, path, grid)
    return Recorded(dict(sorted(counts.items())), simulator.time_s, simulator.robot.way_m, truth)


def write_truth(folder: Path, world: World, scene: Scene, path: list[Odometry], grid: OccupancyGrid) -> None:
    """The true trajectory, map, objects and the world itself; where there are tags, the database of their objects."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / "trajectory.tum", "".join(map(tum_line, path)).encode())
    save_map(grid, folder / "map")
    write_atomic(folder / "objects.csv", objects_csv(world, scene).encode())
    if any(thing.tag for thing in world.things):
        write_atomic(folder / "tags.yaml", tag_database_yaml(world).encode())
    document = world.model_dump(mode="json", exclude_defaults=True)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=110)
    write_atomic(folder / "world.yaml", text.encode())


def tum_line(pose: Odometry) -> str:
    """One line of a TUM file."""
    qw, _, _, qz = quaternion_of_yaw(pose.yaw_rad).tolist()
    return f"{format_stamp(pose.stamp_ns)} {pose.x_m:.6f} {pose.y_m:.6f} 0 0 0 {qz:.9f} {qw:.9f}\n"


def objects_csv(world: World, scene: Scene) -> str:
    """Doors (pose of the hinge, x along the leaf) and objects (pose of the centre) at the end of the log."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["id", "class", "x", "y", "yaw", "moved", "state", "tag", "length", "width"])
    for thing in world.things:
        pose = scene.pose_of(thing)
        if isinstance(thing, Door):
            opening = scene.openings[thing.id]
            first, size = thing.opening_deg, (thing.width_m, thing.thickness_m)
            state, moved = ("open" if abs(opening) > OPEN_FROM_DEG else "closed"), opening != first
        else:
            state, size = "", thing.size
            moved = bool(np.abs(pose - radians(thing.pose)).max() > 1e-9)
        numbers = [f"{value:.6f}" for value in pose.tolist()]
        tag = thing.tag.id if thing.tag else ""
        writer.writerow([thing.id, thing.kind, *numbers, str(moved).lower(), state, tag, *size])
    return text.getvalue()
