"""The fixed cameras of a room: their messages joined to frames, and the frames assigned to scans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import CameraInfo, DepthImage, Image, Transform
from gridslam.methods.ispace_mcl.cameras.camera_frames import CameraFrame, ScanOdometry
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation, moving_cells
from gridslam.methods.ispace_mcl.cameras.frame_pairs import Frame, FramePairs
from gridslam.methods.ispace_mcl.cameras.robot_passes import RobotPasses, lone_object_near
from gridslam.methods.ispace_mcl.cameras.tracks import MovingObjectTracker
from gridslam.sensors.fixed_camera import (
    COLOUR_AND_DEPTH,
    COLOUR_ONLY,
    DetectionParameters,
    FixedCamera,
    FrameSkip,
)
from gridslam.sensors.floor_cells import Floor, FloorCells
from gridslam.sensors.pinhole import Pinhole

Floats = NDArray[np.float64]

SILENT_S = 5.0  # a camera without frames for longer is reported as silent
# A detection says little about a scan that comes later than this: the odometry in between is known, but people move on.
MAX_AGE_S = 0.6
DENSITY_MAX_AGE_S = 1.2  # the density product needs the latest frame of every camera, also of slow ones


class CameraSkip(str, Enum):
    """Reasons why an image of a camera cannot be used; the values are the counters' names."""

    NO_DEPTH = "no_depth"
    OUT_OF_STEP = "out_of_step"
    AFTER_LAST_SCAN = "after_last_scan"
    BETWEEN_UPDATES = "between_updates"
    SIZE_DIFFERS_FROM_DEPTH = "size_differs_from_depth"
    SIZE_CHANGED = "size_changed"
    NO_CALIBRATION = "no_calibration"
    NOT_FIXED = "not_fixed"


class FixedCameras:
    """Collects camera messages and returns, for a scan, the latest frame of each camera that is not too old.

    A camera is identified by the frame of its messages. Every message that is not used is counted: `counters` holds used.image,
    used.depth and skipped.image.<reason>; `reasons` has the same by camera. The robot may be on the cells of `floor`.
    """

    def __init__(
        self,
        root_frame: str,
        floor: Floor,
        parameters: DetectionParameters = COLOUR_AND_DEPTH,
        max_age_s: float = MAX_AGE_S,
    ) -> None:
        self._root_frame = root_frame
        self._floor = floor
        self._parameters = parameters
        self._max_age_s = max_age_s
        self._infos: dict[str, CameraInfo] = {}
        self._sensor_extrinsics: dict[str, Transform] = {}
        self._pairs = FramePairs(self._drop)
        self._shapes: dict[str, tuple[int, int]] = {}
        self._waiting: dict[str, CameraFrame] = {}
        self._latest: dict[str, CameraFrame] = {}  # the last one of each camera that was used
        self._given: list[tuple[str, CameraObservation]] = []  # the last observations, by camera
        self._passes: dict[str, RobotPasses] = {}
        self._trackers: dict[str, MovingObjectTracker] = {}
        self._last_ns: dict[str, int] = {}
        self._path = ScanOdometry()
        self._moving: list[FloorCells] = []  # moving cells of each frame that was used
        self.fixed: dict[str, FixedCamera] = {}
        self.counters: Counter[str] = Counter()
        self.reasons: dict[str, Counter[str]] = {}

    def add_info(self, info: CameraInfo) -> None:
        """Store a calibration; one that is not finite, or has no focal length, is skipped and counted."""
        if not np.isfinite(info.K).all() or not (info.K[0, 0] > 0.0 and info.K[1, 1] > 0.0):
            self.counters["skipped.camera_info.no_focal_length"] += 1
            return
        self.counters["used.camera_info"] += 1
        self._infos.setdefault(info.frame_id, info)

    def add_extrinsics(self, extrinsics: Transform) -> None:
        """Store the static transform of a camera in the room; transforms of sensors on the robot are ignored."""
        if extrinsics.frame_id == self._root_frame:
            self._sensor_extrinsics[extrinsics.child_frame_id] = extrinsics

    def add_image(self, image: Image | DepthImage) -> None:
        """Store a colour or depth image, and process the frame that it completes."""
        frame = self._pairs.add(image)
        if frame is not None:
            self._process(image.frame_id, frame)

    def add_pose(self, stamp_ns: int, odometry: Floats, odometry_jumped: bool) -> None:
        """Store T_odom_base `(3,)` at a scan; a jump of the odometry invalidates all earlier poses."""
        if odometry_jumped:
            self._path = ScanOdometry()
        self._path.add(stamp_ns, odometry)

    def observations_at(self, stamp_ns: int) -> list[CameraObservation]:
        """The latest unused frame of each camera at the stamp of a scan whose pose was added."""
        self._given = []
        for name in sorted(self._waiting):
            frame = self._waiting[name]
            if frame.stamp_ns > stamp_ns:
                continue  # the frame is newer than the scan
            del self._waiting[name]
            observation = frame.observation(self._path, stamp_ns, self._max_age_s)
            if observation is None:
                self._skip(name, CameraSkip.OUT_OF_STEP, frame.streams)
                continue
            self._count_use(name, frame.streams)
            self._latest[name] = frame
            self._moving.append(observation.moving)
            self._given.append((name, observation))
        return [observation for _, observation in self._given]

    def all_observations_at(self, stamp_ns: int) -> list[CameraObservation]:
        """The latest frame of every camera, used before or not; empty unless one of them is new."""
        if not self.observations_at(stamp_ns):
            return []
        frames = (self._latest[name] for name in sorted(self._latest))
        latest = (frame.observation(self._path, stamp_ns, self._max_age_s) for frame in frames)
        return [observation for observation in latest if observation is not None]

    def learn_extrinsics(self, pose: Floats) -> None:
        """Compare where the cameras have seen the robot with its pose `(3,)` at the last scan, of which the lidar is certain."""
        for name, observation in self._given:
            robot = se2.compose(pose, observation.T_now_then)[:2]
            seen = lone_object_near(observation, robot)
            if seen is None:
                continue
            passes = self._passes.setdefault(name, RobotPasses(self.fixed[name].place))
            if (correction := passes.add(seen, robot)) is not None:
                self.fixed[name].correct(correction.pose)

    def coverage(self) -> FloorCells:
        """The floor cells that at least one camera covers."""
        return FloorCells.joined([c.coverage for c in self.fixed.values()], self._parameters.cell_m).unique()

    def moving(self) -> FloorCells:
        """The floor cells with moving objects, repeated for every frame that showed one there."""
        return FloorCells.joined(self._moving, self._parameters.cell_m)

    def finish(self) -> None:
        """Count the messages that no scan used before the log ended, and the cameras that were silent at its end."""
        end_ns = self._path.end_ns or 0
        for name, last_ns in self._last_ns.items():
            if end_ns - last_ns > SILENT_S * 1e9:
                self.reasons[name]["silences"] += 1
        self._pairs.finish()
        for name, frame in self._waiting.items():
            self._skip(name, CameraSkip.AFTER_LAST_SCAN, frame.streams)
        self._waiting.clear()

    def measures(self) -> Mapping[str, object]:
        """For each camera: its frames by use or skip reason, whether it was moved, the floor area that it covers, and how far its
        extrinsics are off by the robot's passes.
        """
        found: dict[str, object] = {}
        for name, reasons in sorted(self.reasons.items()):
            camera, passes = self.fixed.get(name), self._passes.get(name)
            found[name] = {
                "frames": dict(sorted(reasons.items())),
                "moved": camera is not None and camera.is_moved,
                "coverage_m2": 0.0 if camera is None else len(camera.coverage) * self._parameters.cell_m**2,
                "correction": None if passes is None else passes.measures(),
            }
        return found

    def notes(self) -> list[str]:
        """A line for each camera that was moved, or whose extrinsics are wrong."""
        moved = [
            f"camera {name}: was moved; its images from then on were not used"
            for name, camera in sorted(self.fixed.items())
            if camera.is_moved
        ]
        return [
            *moved,
            *(f"camera {name}: {note}" for name, p in sorted(self._passes.items()) for note in p.notes()),
        ]

    def _drop(self, name: str, image: Image | DepthImage) -> None:
        """Count an image without a partner."""
        if isinstance(image, Image):
            self._skip(name, CameraSkip.NO_DEPTH)
        else:
            self.counters["skipped.depth.no_image"] += 1

    def _process(self, name: str, frame: Frame) -> None:
        camera = self._camera(name, frame)
        if isinstance(camera, CameraSkip):
            self._skip(name, camera, frame.streams)
            return
        last = self._last_ns.get(name, frame.stamp_ns)
        if frame.stamp_ns - last > SILENT_S * 1e9:
            self.reasons[name]["silences"] += 1
        self._last_ns[name] = frame.stamp_ns
        detections = camera.detect(frame.pixels, frame.depth_m)
        if isinstance(detections, FrameSkip):
            self._skip(name, detections, frame.streams)
            return
        if name in self._waiting:
            self._skip(name, CameraSkip.BETWEEN_UPDATES, self._waiting[name].streams)
        tracker = self._trackers.setdefault(name, MovingObjectTracker())
        moving = moving_cells(detections, self._parameters.cell_m, self._parameters.min_area_m2)
        in_view = camera.coverage.select(detections.is_visible)
        objects = tracker.add(frame.stamp_ns, moving)
        self._waiting[name] = CameraFrame(frame.stamp_ns, moving, in_view, objects, frame.streams)

    def _camera(self, name: str, frame: Frame) -> FixedCamera | CameraSkip:
        """The camera of a frame, or the reason why it cannot be used."""
        self.reasons.setdefault(name, Counter())
        if frame.shape is None:
            return CameraSkip.SIZE_DIFFERS_FROM_DEPTH
        if name not in self.fixed:
            if name not in self._infos:
                return CameraSkip.NO_CALIBRATION
            if name not in self._sensor_extrinsics:
                return CameraSkip.NOT_FIXED
            is_raw = frame.image is not None and frame.image.is_raw
            pinhole = Pinhole.of(self._infos[name], self._sensor_extrinsics[name], is_raw)
            self.fixed[name] = FixedCamera(pinhole, self._parameters, self._floor)
        if self._shapes.setdefault(name, frame.shape) != frame.shape:
            return CameraSkip.SIZE_CHANGED
        return self.fixed[name]

    def _skip(self, name: str, reason: CameraSkip | FrameSkip, streams: Sequence[str] = ("image",)) -> None:
        for stream in streams:
            self.counters[f"skipped.{stream}.{reason.value}"] += 1
        self.reasons.setdefault(name, Counter())[reason.value] += 1

    def _count_use(self, name: str, streams: Sequence[str]) -> None:
        for stream in streams:
            self.counters[f"used.{stream}"] += 1
        self.reasons[name]["used"] += 1


def detection_parameters(background: str) -> DetectionParameters:
    """The parameters of a background model, by the name that the config uses."""
    return COLOUR_ONLY if background == "colour" else COLOUR_AND_DEPTH
