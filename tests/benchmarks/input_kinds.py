"""One simulated drive, recorded as the log of each kind of robot: clouds, several lidars, no odometry, odd drivers.

The drive is through one room, or through an office floor of its seed. Every kind sees the same walls from the same true poses;
clouds and further lidars are cast here, with the noise of the simulator's lidar. Messages are written with rosbags' own
serialisation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from rosbags.typesys import get_types_from_msg
from scipy.spatial.transform import Rotation

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Imu, LaserScan, Odometry
from gridslam.core.random import random_stream
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.places.build import place_document
from gridslam.simulation.record import tum_line
from gridslam.simulation.scene import Scene
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world
from tests.benchmarks.bench_odometry_faults import late, scaled
from tests.logs.ros_samples import HUMBLE, header, make, tf, transform, write_mcap

Floats = NDArray[np.float64]
Messages = Iterator[tuple[str, Any]]

PERIOD_S, HEIGHT_M, FORWARD_M, CEILING_M = 0.1, 0.6, 0.1, 2.4
OFFICE_TRAVEL_M = 60.0
RINGS_DEG = np.arange(-15.0, 16.0, 2.0)
COLUMNS = 600
WORLD = """
walls:
  - {rectangle: [0, 0, 14, 10]}
  - {points: [[3, 3], [6, 3]]}
  - {points: [[7, 3], [11, 3], [11, 7], [3, 7], [3, 3]]}
  - {points: [[0, 5], [1.2, 5]]}
  - {points: [[8, 7], [8, 8.2]]}
  - {points: [[12.6, 4], [14, 4]]}
boxes:
  - {centre: [0.6, 0.6], size: [0.8, 0.6], yaw_deg: 15}
  - {centre: [6.2, 0.3], size: [1.4, 0.5]}
  - {centre: [13.4, 8.8], size: [0.6, 1.2]}
  - {centre: [4.5, 9.6], size: [1.0, 0.5]}
cylinders: [{centre: [9.5, 1.0], radius_m: 0.2}]
robot:
  start: [1.5, 1.5, 0]
  speed_mps: 0.8
  turn_radps: 1.2
  route: [[12.3, 1.6], [12.2, 8.4], [1.8, 8.5], [1.6, 1.6], [12.0, 1.5]]
sensors:
  lidar: {rate_hz: 10, beams: 360, sweep_s: 0.0997, extrinsics: {x: 0.1, z: 0.6}, range_max_m: 20}
  odometry: {rate_hz: 20}
  gyro: {rate_hz: 100, noise_radps: 0.003, bias_deviation_radps: 0.002}
"""
LIVOX = {
    "livox_ros_driver2/msg/CustomPoint": "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\n"
    "uint8 reflectivity\nuint8 tag\nuint8 line",
    "livox_ros_driver2/msg/CustomMsg": "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n"
    "uint8[3] rsvd\nCustomPoint[] points",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class InputDrive:
    """The simulator's events, the true poses of the robot by time (s after the first stamp), and the walls.

    Robots that sway do so at `sway_radps`: angular frequencies of roll and pitch.
    """

    events: list[Event]
    poses_at: Callable[[Floats], Floats]
    start_ns: int
    scene: Scene
    truth: str
    sway_radps: tuple[float, float]

    def sweeps(self) -> list[LaserScan]:
        return [event for event in self.events if isinstance(event, LaserScan)]


def drive(seed: int, is_elsewhere: bool = False) -> InputDrive:
    """The drive, with errors of wheels and sensors by seed; elsewhere, through an office floor and with a sway of the seed."""
    document = {**yaml.safe_load(WORLD), "seed": seed}
    sway_radps = 2.5, 1.7
    if is_elsewhere:
        place = place_document("office", seed, OFFICE_TRAVEL_M)
        document = {**place, "people": [], "sensors": document["sensors"]}
        slower, faster = np.sort(random_stream(seed, "sway").uniform(1.2, 5.0, 2)).tolist()
        sway_radps = faster, slower
    world = validate_world(document, "inputs")
    simulator = Simulator(world, Path())
    events, truth = [], []
    for event, is_truth in drive_route(simulator):
        (truth if is_truth else events).append(event)
    lines = "".join(tum_line(event) for event in truth if isinstance(event, Odometry))
    return InputDrive(events, simulator.robot.poses_at, world.start_ns, simulator.scene, lines, sway_radps)


@dataclass(frozen=True, slots=True)
class SimulatedSway:
    """A robot that rolls and pitches by `amplitude_deg` about the point of the floor below it, or about its lidar.

    `radps` are the angular frequencies of roll and pitch.
    """

    amplitude_deg: float = 0.0
    is_about_lidar: bool = False
    radps: tuple[float, float] = (0.0, 0.0)

    def angles(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Roll and pitch (rad) at times (s)."""
        amplitude = math.radians(self.amplitude_deg)
        roll_radps, pitch_radps = self.radps
        return amplitude * np.sin(roll_radps * time_s), amplitude * np.sin(pitch_radps * time_s + 1.0)

    def rotations(self, time_s: Floats) -> Rotation:
        """The robot's rotations without its yaw."""
        roll, pitch = self.angles(time_s)
        return Rotation.from_euler("xyz", np.column_stack([roll, pitch, np.zeros(len(roll))]))


LEVEL = SimulatedSway()


def returns(
    drive: InputDrive,
    stamp_ns: int,
    sensor_extrinsics: Floats,
    rays: Floats,
    rng: np.random.Generator,
    sway: SimulatedSway = LEVEL,
) -> tuple[Floats, Floats]:
    """Points `(n, 3)` in the sensor's frame, and their distances `(n,)`, of walls up to the ceiling, it, and the floor.

    `rays` `(n, 3)`: bearing, elevation (rad), time after the stamp (s). `mount` (3,) is T_base_sensor, `HEIGHT_M` above
    the floor.
    """
    times = (stamp_ns - drive.start_ns) * 1e-9 + rays[:, 2]
    robot, tilt = drive.poses_at(times), sway.rotations(times)
    heading = Rotation.from_euler("z", robot[:, 2:])
    about = Rotation.identity(len(rays)) if sway.is_about_lidar else tilt
    above = heading.apply(about.apply(np.array([sensor_extrinsics[0], sensor_extrinsics[1], HEIGHT_M])))
    origin = above + np.pad(robot[:, :2], ((0, 0), (0, 1)))
    flat = np.cos(rays[:, 1])
    rays_xyz = np.column_stack([flat * np.cos(rays[:, 0]), flat * np.sin(rays[:, 0]), np.sin(rays[:, 1])])
    towards = heading.apply(tilt.apply(Rotation.from_euler("z", sensor_extrinsics[2]).apply(rays_xyz)))
    level = np.hypot(towards[:, 0], towards[:, 1])
    hits = drive.scene.cast(np.column_stack([origin[:, :2], towards[:, :2] / level[:, None]]), 60.0, 0.0)
    with np.errstate(divide="ignore"):
        floor_or_ceiling = (
            np.where(towards[:, 2] < 0.0, -origin[:, 2], CEILING_M - origin[:, 2]) / towards[:, 2]
        )
    distance = np.minimum(hits.ranges_m / level, np.where(towards[:, 2] == 0.0, np.inf, floor_or_ceiling))
    distance = distance + rng.normal(0.0, 0.01 + 0.0005 * distance)
    distance[~hits.is_hit | (rng.random(len(distance)) < 0.002)] = np.nan
    return rays_xyz * distance[:, None], distance


def spinning_rays() -> Floats:
    """Rays `(COLUMNS * rings, 3)` of a spinning lidar, column by column."""
    phase = np.arange(COLUMNS) / COLUMNS
    bearing, elevation = np.meshgrid(2 * np.pi * phase - np.pi, np.radians(RINGS_DEG), indexing="ij")
    times = np.broadcast_to((PERIOD_S * phase)[:, None], bearing.shape)
    return np.stack([bearing, elevation, times], axis=-1).reshape(-1, 3)


def scattered_rays(count: int, half_field_deg: float, rng: np.random.Generator) -> Floats:
    """Rays `(count, 3)` of a lidar without a sweep: any bearing at any time."""
    bearing = np.radians(rng.uniform(-half_field_deg, half_field_deg, count))
    elevation = np.radians(rng.uniform(-12.0, 12.0, count))
    return np.column_stack([bearing, elevation, np.sort(rng.uniform(0.0, PERIOD_S, count))])


def cloud_message(stamp_ns: int, points: Floats, times: Floats, rings: int = 0) -> Any:
    """sensor_msgs/PointCloud2: with `rings` organised, with NaN, padding, intensity and ring; else x, y, z, time alone."""
    names = {"x": "<f4", "y": "<f4", "z": "<f4", "intensity": "<f4", "ring": "<u2", "t": "<u4"}
    if not rings:
        names = {"x": "<f4", "y": "<f4", "z": "<f4", "time": "<f4"}
    layout = np.dtype([*names.items(), ("", "V6")]) if rings else np.dtype(list(names.items()))
    rows = np.zeros(len(points), layout)
    rows["x"], rows["y"], rows["z"] = points.T
    rows["t" if rings else "time"] = np.round(times * 1e9) if rings else times
    if rings:
        rows["ring"] = np.tile(np.arange(rings), len(points) // rings)
        rows = rows.reshape(-1, rings).T.copy()
    else:
        rows = rows[np.isfinite(points).all(axis=1)][None]
    kinds = {"<f4": 7, "<u2": 4, "<u4": 6}
    fields = [
        make("sensor_msgs/msg/PointField", name=n, offset=layout.fields[n][1], datatype=kinds[k], count=1)
        for n, k in names.items()
    ]  # fmt: skip
    return make(
        "sensor_msgs/msg/PointCloud2", header=header(stamp_ns, "lidar"), height=rows.shape[0], width=rows.shape[1], fields=fields,
        point_step=layout.itemsize, row_step=layout.itemsize * rows.shape[1], data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=not rings,
    )  # fmt: skip


def scan_message(scan: LaserScan, **changes: Any) -> Any:
    """sensor_msgs/LaserScan of a scan."""
    given = {
        "header": header(scan.stamp_ns, scan.frame_id), "angle_min": scan.angle_min_rad,
        "angle_max": scan.angle_min_rad + scan.angle_increment_rad * (len(scan.ranges_m) - 1),
        "angle_increment": scan.angle_increment_rad, "time_increment": scan.time_increment_s, "scan_time": PERIOD_S,
        "range_min": scan.range_min_m, "range_max": scan.range_max_m, "ranges": np.array(scan.ranges_m),
    }  # fmt: skip
    return make("sensor_msgs/msg/LaserScan", **{**given, **changes})


def echoes_message(scan: LaserScan, rng: np.random.Generator) -> Any:
    """sensor_msgs/MultiEchoLaserScan: the wall is the strongest echo, one in five beams has a weak one before it."""
    echoes, strengths = [], []
    for value in scan.ranges_m.tolist():
        if not math.isfinite(value):
            echoes.append([])
            strengths.append([])
        elif rng.random() < 0.2:
            echoes.append([value * rng.uniform(0.3, 0.9), value])
            strengths.append([20.0, 200.0])
        else:
            echoes.append([value])
            strengths.append([200.0])

    def each(rows: list[list[float]]) -> list[Any]:
        return [make("sensor_msgs/msg/LaserEcho", echoes=np.array(row, np.float32)) for row in rows]

    plain = scan_message(scan)
    same = {
        name: getattr(plain, name)
        for name in plain.__dataclass_fields__
        if name not in ("ranges", "intensities", "__msgtype__")
    }
    return make(
        "sensor_msgs/msg/MultiEchoLaserScan", **same, ranges=each(echoes), intensities=each(strengths)
    )


def odometry_message(event: Odometry) -> Any:
    """nav_msgs/Odometry of a pose."""
    message = make("nav_msgs/msg/Odometry", header=header(event.stamp_ns, "odom"), child_frame_id="base_link")
    position, turned = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y = event.x_m, event.y_m
    turned.w, turned.z = math.cos(event.yaw_rad / 2.0), math.sin(event.yaw_rad / 2.0)
    return message


def imu_message(event: Imu) -> Any:
    """sensor_msgs/Imu of a yaw rate."""
    message = make("sensor_msgs/msg/Imu", header=header(event.stamp_ns, "imu"))
    message.angular_velocity.z = event.wz_radps
    message.orientation_covariance[0] = -1.0
    return message


def placed_sensors(frame: str, x: float = FORWARD_M, yaw_rad: float = 0.0) -> Any:
    """base_link -> frame."""
    return transform(
        0, "base_link", frame, (x, 0.0, HEIGHT_M), (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
    )


def recorded(
    drive: InputDrive,
    path: Path,
    scans: Callable[[LaserScan], Messages],
    frames: tuple[Any, ...],
    odometry: Callable[[Odometry], Odometry | None] = lambda o: o,
    with_imu: bool = False,
    imu: Callable[[Imu], Any] | None = None,
) -> Path:
    """The log: what `scans` makes of each sweep, the odometry changed, and the yaw rates, or what `imu` makes of them."""

    def messages() -> Messages:
        yield "/tf_static", tf(*frames)
        for event in drive.events:
            if isinstance(event, LaserScan):
                yield from scans(event)
            elif isinstance(event, Odometry) and (changed := odometry(event)) is not None:
                yield "/odom", odometry_message(changed)
            elif isinstance(event, Imu) and (with_imu or imu is not None):
                yield "/imu", (imu or imu_message)(event)

    return write_mcap(path, messages())


def plain(drive: InputDrive, path: Path, **changes: Any) -> Path:
    """The ordinary recording; `changes` are keywords of `recorded`."""
    given = {
        "scans": lambda scan: iter([("/scan", scan_message(scan))]),
        "frames": (placed_sensors("laser"),),
    }
    return recorded(drive, path, **{**given, **changes})


def clouds(
    drive: InputDrive,
    path: Path,
    rings: int = 0,
    half_field_deg: float = 0.0,
    is_timed: bool = True,
    **changes: Any,
) -> Path:
    """A spinning lidar, organised where `rings` are named, or one without a sweep in a field of view."""
    rng = np.random.default_rng(5)

    def scans(scan: LaserScan) -> Messages:
        rays = scattered_rays(4000, half_field_deg, rng) if half_field_deg else spinning_rays()
        points, _ = returns(drive, scan.stamp_ns, np.array([FORWARD_M, 0.0, 0.0]), rays, rng)
        yield "/points", cloud_message(scan.stamp_ns, points, rays[:, 2] * is_timed, rings)

    return recorded(drive, path, scans, (placed_sensors("lidar"),), **changes)


def livox(drive: InputDrive, path: Path) -> Path:
    """livox_ros_driver2/CustomMsg with all bearings, as of a Mid-360."""
    rng = np.random.default_rng(6)
    if "livox_ros_driver2/msg/CustomMsg" not in HUMBLE.types:
        HUMBLE.register({k: v for n, text in LIVOX.items() for k, v in get_types_from_msg(text, n).items()})
    point = HUMBLE.types["livox_ros_driver2/msg/CustomPoint"]

    def scans(scan: LaserScan) -> Messages:
        rays = scattered_rays(1500, 180.0, rng)
        points, _ = returns(drive, scan.stamp_ns, np.array([FORWARD_M, 0.0, 0.0]), rays, rng)
        given = np.nan_to_num(points).tolist()
        times = np.round(rays[:, 2] * 1e9).astype(int).tolist()
        made = [point(t, x, y, z, 10, 0, 0) for t, (x, y, z) in zip(times, given, strict=True)]
        head = header(scan.stamp_ns, "lidar")
        yield (
            "/livox/lidar",
            make(
                "livox_ros_driver2/msg/CustomMsg",
                header=head,
                point_num=len(made),
                rsvd=np.zeros(3, np.uint8),
                points=made,
            ),
        )

    return recorded(drive, path, scans, (placed_sensors("lidar"),))


def two_lidars(drive: InputDrive, path: Path, **changes: Any) -> Path:
    """A front lidar of 240 degrees, and one at the back that sees half as far at half the rate."""
    rng = np.random.default_rng(7)
    places = {"front": np.array([0.25, 0.0, 0.0]), "back": np.array([-0.2, 0.0, math.pi])}
    count, field = 320, math.radians(240.0)
    phase = np.arange(count) / (count - 1)
    rays = np.column_stack([field * (phase - 0.5), np.zeros(count), 0.06 * phase])
    sweeps = {scan.stamp_ns: k for k, scan in enumerate(drive.sweeps())}

    def scans(scan: LaserScan) -> Messages:
        for name in ("front", "back")[: 1 + sweeps[scan.stamp_ns] % 2]:
            _, ranges = returns(drive, scan.stamp_ns, places[name], rays, rng)
            max_range_m = 20.0 if name == "front" else 10.0
            ranges = np.where(ranges < max_range_m, ranges, np.inf).astype(np.float32)
            one = replace(
                scan, frame_id=name, ranges_m=ranges, angle_min_rad=-0.5 * field, range_max_m=max_range_m,
                angle_increment_rad=field / (count - 1), time_increment_s=0.06 / (count - 1),
            )  # fmt: skip
            yield f"/{name}/scan", scan_message(one, angle_max=0.5 * field)

    return recorded(
        drive,
        path,
        scans,
        tuple(placed_sensors(n, float(p[0]), float(p[2])) for n, p in places.items()),
        **changes,
    )


def echoes(drive: InputDrive, path: Path) -> Path:
    rng = np.random.default_rng(8)
    return plain(drive, path, scans=lambda scan: iter([("/echoes", echoes_message(scan, rng))]))


def swaying(
    drive: InputDrive,
    path: Path,
    amplitude_deg: float = 4.0,
    is_cloud: bool = False,
    imu: str = "orientation",
    is_about_lidar: bool = False,
) -> Path:
    """A robot that rolls and pitches, with an IMU that says so (`imu` as in `tilted_imu`) or with none (empty)."""
    rng, sway = np.random.default_rng(9), SimulatedSway(amplitude_deg, is_about_lidar, drive.sway_radps)
    sensor_extrinsics = np.array([FORWARD_M, 0.0, 0.0])
    phase = np.arange(360) / 360
    beams = np.column_stack([2 * np.pi * phase - np.pi, np.zeros(360), 0.0997 * phase])

    def scans(scan: LaserScan) -> Messages:
        rays = spinning_rays() if is_cloud else beams
        points, distances = returns(drive, scan.stamp_ns, sensor_extrinsics, rays, rng, sway)
        if is_cloud:
            yield "/points", cloud_message(scan.stamp_ns, points, rays[:, 2])
            return
        one = replace(
            scan, ranges_m=np.where(distances < scan.range_max_m, distances, np.inf).astype(np.float32),
            angle_min_rad=-math.pi, angle_increment_rad=2 * math.pi / 360, time_increment_s=0.0997 / 360,
        )  # fmt: skip
        yield "/scan", scan_message(one)

    frames = (
        placed_sensors("lidar" if is_cloud else "laser"),
        transform(0, "base_link", "imu", (0.0, 0.0, 0.1)),
    )
    made_imu = tilted_imu(drive, sway, imu, rng) if imu else None
    return recorded(drive, path, scans, frames, imu=made_imu)


def tilted_imu(
    drive: InputDrive, sway: SimulatedSway, kind: str, rng: np.random.Generator
) -> Callable[[Imu], Any]:
    """Messages of an IMU on a robot that sways: `orientation` with everything, `gravity` without its orientation.

    `ned` has axes that point forward, right and down; `misaligned` has y forward, and `late` stamps of 0.5 s ago.
    """
    step_s = 0.01

    def message(event: Imu) -> Any:
        late_s = 0.5 if kind == "late" else 0.0
        times = (event.stamp_ns - drive.start_ns) * 1e-9 - late_s + np.array([-step_s, 0.0, step_s])
        poses = drive.poses_at(times)
        attitude = Rotation.from_euler("z", poses[:, 2:]) * sway.rotations(times)
        velocities = np.diff(poses[:, :2], axis=0) / step_s
        acceleration = np.array([*(np.diff(velocities, axis=0)[0] / step_s), 9.81])
        noise = Rotation.from_rotvec(rng.normal(0.0, math.radians(0.2), 3))
        now, rates = attitude[1] * noise, (attitude[0].inv() * attitude[2]).as_rotvec() / (2.0 * step_s)
        force = attitude[1].inv().apply(acceleration)
        if kind == "misaligned":
            aside = Rotation.from_euler("z", math.pi / 2)
            now, rates, force = now * aside, aside.inv().apply(rates), aside.inv().apply(force)
        if kind == "ned":
            down = Rotation.from_euler("x", math.pi)
            now, rates, force = down * now * down, rates * (1, -1, -1), force * (1, -1, -1)
        made = make("sensor_msgs/msg/Imu", header=header(event.stamp_ns, "imu"))
        turned, rate, forced = made.orientation, made.angular_velocity, made.linear_acceleration
        turned.x, turned.y, turned.z, turned.w = now.as_quat().tolist()
        if kind == "gravity":
            turned.x, turned.y, turned.z, turned.w = 0.0, 0.0, 0.0, 1.0
            made.orientation_covariance[0] = -1.0
        rate.x, rate.y, rate.z = (rates + rng.normal(0.001, 0.003, 3)).tolist()
        forced.x, forced.y, forced.z = (force + rng.normal(0.0, 0.05, 3)).tolist()
        return made

    return message


def rays_along(towards: Floats, times_s: Floats) -> Floats:
    """Rays of `returns` along directions `(n, 3)`, at times after the stamp `(n,)` (s)."""
    flat = np.hypot(towards[:, 0], towards[:, 1])
    return np.column_stack(
        [np.arctan2(towards[:, 1], towards[:, 0]), np.arctan2(towards[:, 2], flat), times_s]
    )


def placed_at(frame: str, R_base_sensor: Rotation) -> Any:
    """base_link -> frame, the sensor turned."""
    x, y, z, w = R_base_sensor.as_quat().tolist()
    return transform(0, "base_link", frame, (FORWARD_M, 0.0, HEIGHT_M), (w, x, y, z))


def tilted(
    drive: InputDrive,
    path: Path,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    is_stated: bool = True,
    **changes: Any,
) -> Path:
    """A planar lidar that is tilted on the robot, as its transform says or not."""
    rng, R_base_laser = (
        np.random.default_rng(9),
        Rotation.from_euler("xyz", np.radians([roll_deg, pitch_deg, 0.0])),
    )
    phase = np.arange(360) / 360
    bearings = 2.0 * np.pi * phase - np.pi
    beams = np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros(360)])
    rays = rays_along(R_base_laser.apply(beams), 0.0997 * phase)

    def scans(scan: LaserScan) -> Messages:
        _, distances = returns(drive, scan.stamp_ns, np.array([FORWARD_M, 0.0, 0.0]), rays, rng)
        one = replace(
            scan, ranges_m=np.where(distances < scan.range_max_m, distances, np.inf).astype(np.float32),
            angle_min_rad=-math.pi, angle_increment_rad=2 * math.pi / 360, time_increment_s=0.0997 / 360,
        )  # fmt: skip
        yield "/scan", scan_message(one)

    stated = R_base_laser if is_stated else Rotation.identity()
    return recorded(drive, path, scans, (placed_at("laser", stated),), **changes)


def depth_camera(drive: InputDrive, path: Path, pitch_deg: float = 0.0, **changes: Any) -> Path:
    """The points of a depth camera in its optical frame: 87 x 58 degrees, up to 6 m, noise that grows with the square."""
    rng = np.random.default_rng(5)
    columns, rows = np.meshgrid(
        np.linspace(-1.0, 1.0, 160) * math.tan(math.radians(43.5)),
        np.linspace(-1.0, 1.0, 120) * math.tan(math.radians(29.0)),
    )
    pixels = np.column_stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    lengths = np.linalg.norm(pixels, axis=1)
    optical = Rotation.from_euler("xyz", [-math.pi / 2.0, 0.0, -math.pi / 2.0])
    R_base_camera = Rotation.from_euler("y", math.radians(pitch_deg)) * optical
    times_s = np.zeros(len(pixels))
    rays = rays_along(R_base_camera.apply(pixels), times_s)

    def scans(scan: LaserScan) -> Messages:
        _, distances = returns(drive, scan.stamp_ns, np.array([FORWARD_M, 0.0, 0.0]), rays, rng)
        depths = distances / lengths
        depths = depths + rng.normal(0.0, 1.0, len(depths)) * 0.0015 * np.nan_to_num(depths) ** 2
        depths[depths > 6.0] = np.nan
        yield "/camera/depth/points", cloud_message(scan.stamp_ns, pixels * depths[:, None], times_s)

    return recorded(drive, path, scans, (placed_at("lidar", R_base_camera),), **changes)


def scanning(*spans_s: tuple[float, float], **changes: Any) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording of a lidar that scans within spans of time (s): it starts late, pauses, or dies."""

    def make_log(drive: InputDrive, path: Path) -> Path:
        def scans(scan: LaserScan) -> Messages:
            time_s = (scan.stamp_ns - drive.start_ns) * 1e-9
            if any(first_s <= time_s < last_s for first_s, last_s in spans_s):
                yield "/scan", scan_message(scan)

        return plain(drive, path, scans=scans, **changes)

    return make_log


def narrow(drive: InputDrive, path: Path) -> Path:
    """The ordinary lidar with the field of view of a solid-state one: 120 degrees."""

    def scans(scan: LaserScan) -> Messages:
        cut = slice(120, 240)
        first = scan.angle_min_rad + 120 * scan.angle_increment_rad
        stamp = scan.stamp_ns + round(120e9 * scan.time_increment_s)
        yield (
            "/scan",
            scan_message(replace(scan, stamp_ns=stamp, ranges_m=scan.ranges_m[cut], angle_min_rad=first)),
        )

    return plain(drive, path, scans=scans)


def timed(**changes: Any) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording whose scans have other times: `late_s` added to their stamps, another `time_increment`."""
    late_s = changes.pop("late_s", 0.0)

    def make_log(drive: InputDrive, path: Path) -> Path:
        def scans(scan: LaserScan) -> Messages:
            yield (
                "/scan",
                scan_message(replace(scan, stamp_ns=scan.stamp_ns + round(late_s * 1e9)), **changes),
            )

        return plain(drive, path, scans=scans)

    return make_log


def hanging(spans_s: tuple[tuple[float, float], ...], **changes: Any) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording of a lidar whose driver gives its last scan again within spans of time (s)."""

    def make_log(drive: InputDrive, path: Path) -> Path:
        last: list[LaserScan] = []

        def scans(scan: LaserScan) -> Messages:
            time_s = (scan.stamp_ns - drive.start_ns) * 1e-9
            if last and any(start_s <= time_s < end_s for start_s, end_s in spans_s):
                scan = replace(last[0], stamp_ns=scan.stamp_ns)
            last[:] = [scan]
            yield "/scan", scan_message(scan)

        return plain(drive, path, scans=scans, **changes)

    return make_log


def twice(drive: InputDrive, path: Path, **changes: Any) -> Path:
    """The ordinary recording of a relay that publishes every scan again, half a period later."""

    def scans(scan: LaserScan) -> Messages:
        for late_s in (0.0, 0.5 * PERIOD_S):
            yield "/scan", scan_message(replace(scan, stamp_ns=scan.stamp_ns + round(late_s * 1e9)))

    return plain(drive, path, scans=scans, **changes)


def odometry(
    change: Callable[[Odometry], Odometry | None], with_imu: bool = False
) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording with another odometry."""
    return lambda drive, path: plain(drive, path, odometry=change, with_imu=with_imu)


def rotated(
    factor: float = 1.0, per_m_rad: float = 0.0, per_s_rad: float = 0.0
) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording whose odometry has integrated wrong rotations: of another scale, and drifting."""

    def make_log(drive: InputDrive, path: Path) -> Path:
        last: list[tuple[Odometry, Floats]] = []

        def change(event: Odometry) -> Odometry:
            pose = event.pose
            if last:
                before, wrong = last.pop()
                x, y, yaw = se2.between(before.pose, pose).tolist()
                elapsed_s = (event.stamp_ns - before.stamp_ns) * 1e-9
                pose = se2.compose(wrong, [x, y, factor * yaw + per_m_rad * x + per_s_rad * elapsed_s])
            last.append((event, pose))
            x, y, yaw = pose.tolist()
            return replace(event, x_m=x, y_m=y, yaw_rad=yaw)

        return plain(drive, path, odometry=change)

    return make_log


def wrong_imu(change: Callable[[Imu], Imu], has_odometry: bool = False) -> Callable[[InputDrive, Path], Path]:
    """The ordinary recording with another IMU, and without odometry unless it has it."""
    return lambda drive, path: plain(
        drive,
        path,
        odometry=lambda event: event if has_odometry else None,
        imu=lambda event: imu_message(change(event)),
    )


ORDINARY = {"ordinary": plain, "ordinary_narrow": narrow}
KINDS: dict[str, tuple[Callable[[InputDrive, Path], Path], str]] = {
    "cloud": (clouds, "ordinary"),
    "cloud_organised": (lambda d, p: clouds(d, p, rings=len(RINGS_DEG)), "ordinary"),
    "cloud_solid_state": (lambda d, p: clouds(d, p, half_field_deg=60.0), "ordinary_narrow"),
    "livox": (livox, "ordinary"),
    "multi_echo": (echoes, "ordinary"),
    "two_lidars": (two_lidars, "ordinary"),
    "no_odometry": (odometry(lambda o: None), "ordinary"),
    "no_odometry_imu": (odometry(lambda o: None, with_imu=True), "ordinary"),
    "imu": (odometry(lambda o: o, with_imu=True), "ordinary"),
    "sweep_unknown": (timed(time_increment=0.0, scan_time=0.0), "ordinary"),
    "stamp_at_end": (timed(late_s=0.0997), "ordinary"),
    "odometry_scaled_0.8": (odometry(scaled(0.8)), "ordinary"),
    "odometry_scaled_1.25": (odometry(scaled(1.25)), "ordinary"),
    "odometry_late": (odometry(late(0.15)), "ordinary"),
    "odometry_mirrored": (odometry(lambda o: replace(o, yaw_rad=-o.yaw_rad)), "ordinary"),
    "swaying_8": (lambda d, p: swaying(d, p, 8.0), "ordinary"),
    "swaying_cloud_4": (lambda d, p: swaying(d, p, is_cloud=True), "ordinary"),
    "swaying_gravity": (lambda d, p: swaying(d, p, imu="gravity"), "ordinary"),
    "swaying_ned": (lambda d, p: swaying(d, p, imu="ned"), "ordinary"),
    "swaying_late": (lambda d, p: swaying(d, p, imu="late"), "ordinary"),
    "swaying_2_unknown": (lambda d, p: swaying(d, p, 2.0, imu=""), "ordinary"),
    "swaying_4_unknown": (lambda d, p: swaying(d, p, 4.0, imu=""), "ordinary"),
    "swaying_8_unknown": (lambda d, p: swaying(d, p, 8.0, imu=""), "ordinary"),
    "swaying_misaligned": (lambda d, p: swaying(d, p, imu="misaligned"), "ordinary"),
    "scans_twice": (twice, "ordinary"),
    "lidar_hangs_1s": (hanging(((8, 9), (16, 17), (27, 28), (38, 39))), "ordinary"),
    "lidar_hangs_10s": (hanging(((15, 25),)), "ordinary"),
    "lidar_dies": (scanning((0.0, 25.0)), "ordinary"),
    "lidar_starts_late": (scanning((8.0, math.inf)), "ordinary"),
    "lidar_pauses_20s": (scanning((0.0, 22.0), (42.0, math.inf)), "ordinary"),
    "tilted_lidar": (lambda d, p: tilted(d, p, pitch_deg=10.0), "ordinary"),
    "tilted_lidar_unknown": (lambda d, p: tilted(d, p, pitch_deg=10.0, is_stated=False), "ordinary"),
    "upside_down_imu": (
        lambda d, p: tilted(d, p, roll_deg=180.0, is_stated=False, with_imu=True),
        "ordinary",
    ),
}
MORE_KINDS: dict[str, tuple[Callable[[InputDrive, Path], Path], str]] = {
    "rotation_0.9": (rotated(0.9), "ordinary"),
    "rotation_1.1": (rotated(1.1), "ordinary"),
    "unequal_wheels": (rotated(per_m_rad=0.12), "ordinary"),
    "drifting_gyro": (rotated(per_s_rad=0.05), "ordinary"),
    "odometry_of_another_frame": (
        odometry(lambda o: replace(o, yaw_rad=o.yaw_rad + math.pi / 2.0)),
        "ordinary",
    ),
    "half_time_increment": (timed(time_increment=0.5 * 0.0997 / 359), "ordinary"),
    "double_time_increment": (timed(time_increment=2.0 * 0.0997 / 359), "ordinary"),
    "imu_in_degrees": (wrong_imu(lambda i: replace(i, wz_radps=math.degrees(i.wz_radps))), "ordinary"),
    "imu_mirrored": (wrong_imu(lambda i: replace(i, wz_radps=-i.wz_radps)), "ordinary"),
    "imu_late": (wrong_imu(lambda i: replace(i, stamp_ns=i.stamp_ns + 200_000_000)), "ordinary"),
    "cloud_untimed": (lambda d, p: clouds(d, p, is_timed=False), "ordinary"),
    "cloud_no_odometry": (lambda d, p: clouds(d, p, odometry=lambda o: None), "ordinary"),
    "solid_state_no_odometry_imu": (
        lambda d, p: clouds(d, p, half_field_deg=60.0, odometry=lambda o: None, with_imu=True),
        "ordinary_narrow",
    ),
    "depth_camera": (depth_camera, "ordinary_narrow"),
    "depth_camera_pitched": (lambda d, p: depth_camera(d, p, pitch_deg=15.0), "ordinary_narrow"),
    "tilted_lidar_up": (lambda d, p: tilted(d, p, pitch_deg=-10.0), "ordinary"),
    "tilted_lidar_aside": (lambda d, p: tilted(d, p, roll_deg=10.0), "ordinary"),
    "tilted_lidar_aside_unknown": (lambda d, p: tilted(d, p, roll_deg=10.0, is_stated=False), "ordinary"),
    "upside_down": (lambda d, p: tilted(d, p, roll_deg=180.0, is_stated=False), "ordinary"),
    "wheels_exchanged": (odometry(lambda o: replace(o, y_m=-o.y_m, yaw_rad=-o.yaw_rad)), "ordinary"),
    "wheels_exchanged_imu": (
        odometry(lambda o: replace(o, y_m=-o.y_m, yaw_rad=-o.yaw_rad), with_imu=True),
        "ordinary",
    ),
    "lidar_dies_no_odometry": (scanning((0.0, 25.0), odometry=lambda o: None), "ordinary"),
    "swaying_about_lidar": (lambda d, p: swaying(d, p, is_about_lidar=True), "ordinary"),
    "swaying_about_lidar_8": (lambda d, p: swaying(d, p, 8.0, is_about_lidar=True), "ordinary"),
    "swaying_lidar_8_unknown": (lambda d, p: swaying(d, p, 8.0, imu="", is_about_lidar=True), "ordinary"),
    "swaying_cloud_about_lidar": (lambda d, p: swaying(d, p, is_cloud=True, is_about_lidar=True), "ordinary"),
    "swaying_cloud_gravity": (lambda d, p: swaying(d, p, is_cloud=True, imu="gravity"), "ordinary"),
    **{
        f"swaying{'_cloud' * is_cloud}_{angle}{'' if imu else '_unknown'}": (
            lambda d, p, angle=angle, is_cloud=is_cloud, imu=imu: swaying(d, p, angle, is_cloud, imu),
            "ordinary",
        )
        for angle in (2, 4, 8)
        for is_cloud in (False, True)
        for imu in ("orientation", "")
        if is_cloud or imu
    },
    "scans_twice_no_odometry": (lambda d, p: twice(d, p, odometry=lambda o: None), "ordinary"),
    "two_lidars_no_odometry": (lambda d, p: two_lidars(d, p, odometry=lambda o: None), "ordinary"),
}
