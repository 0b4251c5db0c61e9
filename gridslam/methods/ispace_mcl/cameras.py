"""The fixed cameras of a room: their messages joined to frames, and the frames to the moment of a scan."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import CameraInfo, DepthImage, Image, Transform
from gridslam.core.trajectory import pose_at
from gridslam.methods.ispace_mcl.camera_config import CamerasConfig
from gridslam.methods.ispace_mcl.environment import Frame, moving_cells
from gridslam.sensors.fixed_camera import CameraSettings, FixedCamera, Pinhole, Sighting

Floats = NDArray[np.float64]

_KEPT_POSES = 200
_SETTINGS = CameraSettings.__dataclass_fields__.keys()


class Cameras:
    """Takes in what cameras say; hands out, for a scan, the latest frame of each that is not too old.

    A camera is known by the frame that its messages carry. Nothing is dropped without a count: `counters` holds used.image,
    used.depth and skipped.image.<reason>; `reasons` the same by camera.
    """

    def __init__(self, config: CamerasConfig, floor: Floats) -> None:
        self._config = config
        self._floor = floor  # centres (k, 2) of the floor cells on which the robot may be
        self._settings = CameraSettings(**config.model_dump(include=set(_SETTINGS)))
        self._infos: dict[str, CameraInfo] = {}
        self._sensor_extrinsics: dict[str, Transform] = {}
        self._images: dict[str, Image] = {}
        self._depths: dict[str, DepthImage] = {}
        self._waiting: dict[str, tuple[int, Sighting]] = {}
        self._latest: dict[str, tuple[int, Sighting]] = {}  # of those handed out
        self._last_ns: dict[str, int] = {}
        self._path: deque[tuple[int, Floats]] = deque(maxlen=_KEPT_POSES)
        self._moved: list[Floats] = []  # what moved in each frame used
        self.fixed: dict[str, FixedCamera] = {}
        self.counters: Counter[str] = Counter()
        self.reasons: dict[str, Counter[str]] = {}

    def add_info(self, info: CameraInfo) -> None:
        """Take in a calibration; one that is not finite, or without a focal length, is refused."""
        if not np.isfinite(info.K).all() or not (info.K[0, 0] > 0.0 and info.K[1, 1] > 0.0):
            self.counters["skipped.camera_info.no_focal_length"] += 1
            return
        self.counters["used.camera_info"] += 1
        self._infos.setdefault(info.frame_id, info)

    def add_extrinsics(self, extrinsics: Transform) -> None:
        """Take in where a sensor is fixed; those on the robot do not count."""
        if extrinsics.frame_id == self._config.frame:
            self._sensor_extrinsics[extrinsics.child_frame_id] = extrinsics

    def add_image(self, image: Image) -> None:
        """Take in a colour image."""
        name = image.frame_id
        if self._images.pop(name, None) is not None:
            self._skip(name, "no_depth")
        self._images[name] = image
        self._join(name)

    def add_depth(self, depth: DepthImage) -> None:
        """Take in a depth image."""
        name = depth.frame_id
        if self._depths.pop(name, None) is not None:
            self.counters["skipped.depth.no_image"] += 1
        self._depths[name] = depth
        self._join(name)

    def add_pose(self, stamp_ns: int, odometry: Floats, broken: bool) -> None:
        """Take in T_odom_base at a scan; after a jump the poses before it mean nothing."""
        if broken:
            self._path.clear()
        self._path.append((stamp_ns, odometry))

    def frames_at(self, stamp_ns: int) -> list[Frame]:
        """The latest unused frame of each camera for the moment of a scan whose pose was added."""
        frames = []
        for name in sorted(self._waiting):
            then_ns, sighting = self._waiting[name]
            if then_ns > stamp_ns:
                continue  # its moment has yet to come
            del self._waiting[name]
            frame = self._frame(name, then_ns, sighting, stamp_ns)
            if frame is None:
                self._skip(name, "out_of_step", with_depth=True)
                continue
            self._use(name)
            self._latest[name] = then_ns, sighting
            self._moved.append(frame.moving)
            frames.append(frame)
        return frames

    def all_frames_at(self, stamp_ns: int) -> list[Frame]:
        """The latest frame of every camera, used before or not; none when none of them is new."""
        if not self.frames_at(stamp_ns):
            return []
        frames = (self._frame(name, *self._latest[name], stamp_ns) for name in sorted(self._latest))
        return [frame for frame in frames if frame is not None]

    def _frame(self, name: str, then_ns: int, sighting: Sighting, stamp_ns: int) -> Frame | None:
        """A camera's sighting with the way that the robot has gone since; None when that is not known, or long ago."""
        place = self._pose_at(then_ns)
        if place is None or stamp_ns - then_ns > self._config.most_age_s * 1e9:
            return None
        moving = moving_cells(sighting, self._config.cell_m, self._config.least_area_m2)
        in_view = self.fixed[name].coverage[sighting.seen]
        return Frame(moving, in_view, se2.between(self._path[-1][1], place))

    def coverage(self) -> Floats:
        """Centres `(k, 2)` of the floor cells that some camera sees."""
        seen = [camera.coverage for camera in self.fixed.values()]
        return np.unique(np.concatenate(seen), axis=0) if seen else np.zeros((0, 2))

    def moving(self) -> Floats:
        """Centres `(m, 2)` of the floor cells in which something moved, once for every frame that showed it."""
        return np.concatenate([*self._moved, np.zeros((0, 2))])

    def finish(self) -> None:
        """Count what was left over when the log ended, and the cameras that had fallen silent by then."""
        end_ns = self._path[-1][0] if self._path else 0
        for name, last_ns in self._last_ns.items():
            if end_ns - last_ns > self._config.silent_s * 1e9:
                self.reasons[name]["silences"] += 1
        for name in list(self._images):
            self._skip(name, "no_depth")
        self.counters["skipped.depth.no_image"] += len(self._depths)
        for name in list(self._waiting):
            self._skip(name, "after_last_scan", with_depth=True)
        self._images.clear()
        self._depths.clear()
        self._waiting.clear()

    def measures(self) -> Mapping[str, object]:
        """By camera: its frames by what became of them, the area that it covers, and whether it was moved."""
        return {
            name: {
                "frames": dict(sorted(reasons.items())),
                "moved": name in self.fixed and self.fixed[name].is_moved,
                "coverage_m2": len(self.fixed[name].coverage) * self._config.cell_m**2
                if name in self.fixed
                else 0.0,
            }
            for name, reasons in sorted(self.reasons.items())
        }

    def _join(self, name: str) -> None:
        """Colour and depth of one moment become a frame."""
        image, depth = self._images.get(name), self._depths.get(name)
        if image is None or depth is None:
            return
        apart_s = (image.stamp_ns - depth.stamp_ns) * 1e-9
        if abs(apart_s) > self._config.pair_tolerance_s:
            if apart_s < 0.0:  # the older of the two waits for nothing any more
                del self._images[name]
                self._skip(name, "no_depth")
            else:
                del self._depths[name]
                self.counters["skipped.depth.no_image"] += 1
            return
        del self._images[name], self._depths[name]
        self._look(name, image, depth)

    def _look(self, name: str, image: Image, depth: DepthImage) -> None:
        camera = self._camera(name, image, depth)
        if isinstance(camera, str):
            self._skip(name, camera, with_depth=True)
            return
        last = self._last_ns.get(name, image.stamp_ns)
        if image.stamp_ns - last > self._config.silent_s * 1e9:
            self.reasons[name]["silences"] += 1
        self._last_ns[name] = image.stamp_ns
        sighting = camera.look(image.pixels, depth.depth_m)
        if isinstance(sighting, str):
            self._skip(name, sighting, with_depth=True)
            return
        if name in self._waiting:
            self._skip(name, "between_updates", with_depth=True)
        self._waiting[name] = (image.stamp_ns, sighting)

    def _camera(self, name: str, image: Image, depth: DepthImage) -> FixedCamera | str:
        """The camera of a frame, or why it cannot be used."""
        self.reasons.setdefault(name, Counter())
        if image.pixels.shape[:2] != depth.depth_m.shape:
            return "size_differs_from_depth"
        if name not in self.fixed:
            if name not in self._infos:
                return "no_calibration"
            if name not in self._sensor_extrinsics:
                return "not_fixed"
            pinhole = Pinhole.of(self._infos[name], self._sensor_extrinsics[name])
            self.fixed[name] = FixedCamera(pinhole, self._settings, self._floor)
        known = self.fixed[name].depth.depth_m
        if known is not None and known.shape != depth.depth_m.shape:
            return "size_changed"
        return self.fixed[name]

    def _pose_at(self, stamp_ns: int) -> Floats | None:
        """T_odom_base at a moment between scans; None before the first."""
        if not self._path or stamp_ns < self._path[0][0]:
            return None
        if stamp_ns >= self._path[-1][0]:
            return self._path[-1][1]
        return pose_at(stamp_ns, [stamp for stamp, _ in self._path], [pose for _, pose in self._path])

    def _skip(self, name: str, reason: str, with_depth: bool = False) -> None:
        self.counters[f"skipped.image.{reason}"] += 1
        if with_depth:
            self.counters[f"skipped.depth.{reason}"] += 1
        self.reasons.setdefault(name, Counter())[reason] += 1

    def _use(self, name: str) -> None:
        self.counters["used.image"] += 1
        self.counters["used.depth"] += 1
        self.reasons[name]["used"] += 1
