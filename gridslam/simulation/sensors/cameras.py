"""Simulated cameras: stereo and RGB-D on the robot, RGB-D fixed in the world."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.cameras import quaternion_of_matrix
from gridslam.core.messages import CameraInfo, DepthImage, Event, Image, StereoPair, Transform, readonly
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.camera_config import RgbdCamera, StereoCamera
from gridslam.simulation.sensors.extrinsics import planar
from gridslam.simulation.sensors.mesh import Mesh, joined, moving_mesh, robot_mesh, static_mesh
from gridslam.simulation.sensors.renderer import CameraView, Renderer
from gridslam.simulation.sensors.sensor_config import SensorExtrinsics
from gridslam.simulation.sensors.timing import Schedule

Array = NDArray[np.float64]
EDGE_FRACTION = 0.05  # a depth step larger than this fraction of the depth casts a shadow in the depth image
GREY = np.array([0.299, 0.587, 0.114], np.float32)


class CameraSensor:
    """One camera with its own schedule.

    With `is_fixed` the extrinsics are in the map frame, and the robot is rendered as part of the scene.
    """

    def __init__(
        self,
        config: RgbdCamera | StereoCamera,
        start_ns: int,
        rng: np.random.Generator,
        folder: Path,
        is_fixed: bool,
    ) -> None:
        self._config = config
        self._rng = rng
        self._folder = folder
        self._is_fixed = is_fixed
        self._schedule = Schedule(config, start_ns, rng, phase=0.4)
        self._renderer = Renderer(config.width_px, config.height_px, config.focal_px)
        self._static_mesh: Mesh | None = None
        self.frame = f"{config.name}_optical"

    def infos(self, stamp_ns: int) -> list[CameraInfo]:
        """The camera's calibration messages: one for RGB-D, left and right for stereo."""
        if isinstance(self._config, RgbdCamera):
            return [self._info(stamp_ns, self._config.name, 0.0)]
        baseline = self._config.baseline_m
        return [
            self._info(stamp_ns, f"{self._config.name}/left", 0.0),
            self._info(stamp_ns, f"{self._config.name}/right", baseline),
        ]

    def extrinsics(self, stamp_ns: int, parent: str) -> Transform:
        """T_parent_optical as a static transform; the optical frame has x right, y down, z along the view."""
        extrinsics = self._config.extrinsics
        forward, left, up = axes(extrinsics, 0.0).T
        quat = quaternion_of_matrix(np.column_stack([-left, -up, forward]))
        return Transform(
            stamp_ns,
            parent,
            child_frame_id=self.frame,
            translation_m=(extrinsics.x, extrinsics.y, extrinsics.z),
            quat_wxyz=quat,
            is_static=True,
        )

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The images taken at this step."""
        if not self._schedule.is_due(now_ns):
            return []
        self._schedule.advance()
        stamp = self._schedule.stamp_ns(now_ns)
        if stamp is None:
            return []
        mesh = self._mesh(robot, scene, now_ns * 1e-9)
        if isinstance(self._config, RgbdCamera):
            return self._rgbd(self._config, stamp, mesh, robot)
        return self._stereo(self._config, stamp, mesh, robot)

    def _mesh(self, robot: DrivenRobot, scene: Scene, time_s: float) -> Mesh:
        if self._static_mesh is None:
            self._static_mesh = static_mesh(scene.world, self._folder, scene)
        parts = [self._static_mesh, moving_mesh(scene.world, scene, time_s)]
        if self._is_fixed:
            parts.append(robot_mesh(scene.world, robot))
        return joined(parts)

    def _view(self, mesh: Mesh, robot: DrivenRobot, right_offset_m: float = 0.0) -> CameraView:
        base = np.zeros(3) if self._is_fixed else robot.pose
        extrinsics = self._config.extrinsics
        x, y, _ = se2.compose(base, planar(extrinsics)).tolist()
        rotation = axes(extrinsics, float(base[2]))
        position = np.array([x, y, extrinsics.z]) - right_offset_m * rotation[:, 1]
        return self._renderer.render(mesh, position, rotation)

    def _rgbd(self, config: RgbdCamera, stamp: int, mesh: Mesh, robot: DrivenRobot) -> list[Event]:
        view = self._view(mesh, robot)
        colour = readonly(self._exposed(view.colour), np.uint8)
        depth = readonly(noisy_depth(config, view, self._rng), np.float32)
        return [
            *self.infos(stamp),
            Image(stamp, self.frame, colour, config.name),
            DepthImage(stamp, self.frame, depth, config.name),
        ]

    def _stereo(self, config: StereoCamera, stamp: int, mesh: Mesh, robot: DrivenRobot) -> list[Event]:
        views = (self._view(mesh, robot), self._view(mesh, robot, config.baseline_m))
        left, right = (readonly(self._exposed(view.colour @ GREY), np.uint8) for view in views)
        return [*self.infos(stamp), StereoPair(stamp, self.frame, left, right)]

    def _exposed(self, light: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Pixel values of light levels (0 to 255), with noise."""
        noise = self._config.noise_levels * self._rng.standard_normal(light.shape, np.float32)
        return np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)

    def _info(self, stamp_ns: int, name: str, baseline_m: float) -> CameraInfo:
        c = self._config
        K = np.array(
            [[c.focal_px, 0, 0.5 * (c.width_px - 1)], [0, c.focal_px, 0.5 * (c.height_px - 1)], [0, 0, 1]]
        )
        P = np.column_stack([K, [-c.focal_px * baseline_m, 0.0, 0.0]])
        K, P, D = (readonly(values, np.float64) for values in (K, P, np.zeros(5)))
        return CameraInfo(
            stamp_ns, self.frame, width_px=c.width_px, height_px=c.height_px, K=K, P=P, D=D, camera=name
        )


def noisy_depth(config: RgbdCamera, view: CameraView, rng: np.random.Generator) -> NDArray[np.float32]:
    """Depths `(rows, cols)` (m) as the sensor reports them, NaN where it reports none."""
    depth = view.depth_m.astype(np.float64)
    normal, hole = rng.standard_normal(depth.shape, np.float32), rng.random(depth.shape, np.float32)
    with np.errstate(invalid="ignore"):
        sigma = config.depth_noise_m + config.depth_noise_per_m2 * depth**2
        found = depth + config.depth_offset_m + sigma * normal
        if config.depth_resolution_m:
            found = np.round(found / config.depth_resolution_m) * config.depth_resolution_m
    lost = (hole < config.holes) | ~(depth >= config.depth_min_m) | ~(depth <= config.depth_max_m)
    lost |= view.cosine < math.cos(math.radians(config.grazing_deg))
    if config.edge_shadow:
        lost |= _beside_edges(depth)
    return np.where(lost, np.nan, found).astype(np.float32)


def _beside_edges(depth: Array) -> NDArray[np.bool_]:
    """Mask `(rows, cols)` of far pixels whose left neighbour is much nearer: the projector's light does not reach them."""
    shadow = np.zeros(depth.shape, bool)
    with np.errstate(invalid="ignore"):
        shadow[:, 1:] = depth[:, 1:] - depth[:, :-1] > EDGE_FRACTION * depth[:, 1:]
    return shadow


def axes(extrinsics: SensorExtrinsics, base_yaw_rad: float) -> Array:
    """Axes of a camera in the map frame as columns forward, left, up `(3, 3)`; pitch is positive downwards."""
    yaw, pitch = base_yaw_rad + math.radians(extrinsics.yaw_deg), math.radians(extrinsics.pitch_deg)
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    return np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])
