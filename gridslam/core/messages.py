"""Messages of sensors, independent of the file that they were read from.

Every message carries `stamp_ns` (integer nanoseconds, never rounded) and `frame_id`. Arrays are read-only. A message has the
same values in every file format: what ROS stores as float32 is rounded to float32, and yaw angles are rounded to 2^-40 rad. So a
log and its conversion give the same run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Scalar = TypeVar("Scalar", bound=np.generic)
_YAW_STEPS_PER_RAD = float(2**40)
_LARGEST_YAW_STEPS = math.floor(math.pi * _YAW_STEPS_PER_RAD)
_SAFE_FLOAT32 = 3.4e38  # a little less than the largest float32


def canonical_yaw(yaw_rad: float) -> float:
    """Yaw rounded to 2^-40 rad (1e-12), so that conversion to a quaternion and back gives the same number.

    A yaw in [-pi, pi] stays in it: beyond, the quaternion would give back the yaw less one revolution.
    """
    if not math.isfinite(yaw_rad):
        return yaw_rad
    steps = round(yaw_rad * _YAW_STEPS_PER_RAD)
    if abs(steps) > _LARGEST_YAW_STEPS and abs(yaw_rad) <= math.pi:
        steps = _LARGEST_YAW_STEPS if steps > 0 else -_LARGEST_YAW_STEPS
    return steps / _YAW_STEPS_PER_RAD


def as_float32(value: float) -> float:
    """The value as ROS would store it in a float32 field; infinite if it is too large for one."""
    if abs(value) < _SAFE_FLOAT32:  # saves errstate, which doubles the time of a call
        return float(np.float32(value))
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def readonly(values: ArrayLike, dtype: type[Scalar]) -> NDArray[Scalar]:
    """A contiguous read-only array of the given type and the same shape (a view where no conversion is needed)."""
    with np.errstate(over="ignore"):  # a double that is too large for a float32 is infinite
        array = np.ascontiguousarray(values, dtype=dtype).view()
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True)
class Transform:
    """T_parent_child: the pose of the child frame in the parent frame. The extrinsics of a sensor are a static transform."""

    stamp_ns: int
    frame_id: str  # parent
    child_frame_id: str
    translation_m: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    is_static: bool = False


@dataclass(frozen=True, slots=True)
class LaserScan:
    """One sweep of a planar lidar: beam i points to angle_min_rad + i * angle_increment_rad in the sensor's frame.

    `ranges_m` is float32 `(n,)` as recorded, including values outside [range_min_m, range_max_m], NaN and infinities.

    These fields serve checks of the log. `angle_max_rad` is the angle that the message states for its last beam, NaN if it states
    none. `other_increment_rad` is the stated increment if it was replaced by one computed from the stated angles, else NaN.
    `has_uncertain_sense`: those two increments have opposite signs, so the beams go either clockwise or counter-clockwise.
    `is_of_cloud`: the scan was made from a point cloud, whose points can have any height.
    """

    stamp_ns: int
    frame_id: str
    ranges_m: NDArray[np.float32]
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float
    time_increment_s: float = 0.0
    angle_max_rad: float = field(default=float("nan"), compare=False)
    has_uncertain_sense: bool = field(default=False, compare=False)
    other_increment_rad: float = field(default=float("nan"), compare=False)
    is_of_cloud: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class PointCloud:
    """Returns of a 3-D lidar or depth camera in the sensor's frame: `points_m` float32 `(n, 3)`, finite.

    `times_s` float32 `(n,)` are the points' times after the stamp, or empty where the log has none.
    """

    stamp_ns: int
    frame_id: str
    points_m: NDArray[np.float32]
    times_s: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Odometry:
    """T_odom_base, and velocities in the robot's frame (NaN if the log has none)."""

    stamp_ns: int
    frame_id: str
    x_m: float
    y_m: float
    yaw_rad: float
    vx_mps: float = float("nan")
    wz_radps: float = float("nan")
    child_frame_id: str = "base_link"

    @property
    def pose(self) -> NDArray[np.float64]:
        """(x, y, yaw) as an array `(3,)`."""
        return np.array([self.x_m, self.y_m, self.yaw_rad])

    @property
    def is_finite(self) -> bool:
        """Whether x, y and yaw are all finite."""
        return math.isfinite(self.x_m) and math.isfinite(self.y_m) and math.isfinite(self.yaw_rad)


@dataclass(frozen=True, slots=True)
class Imu:
    """Turn rates about the sensor's axes and, where measured, its orientation and acceleration.

    `wz_radps` is the yaw rate if the sensor is level. `quat_wxyz` is the orientation in a frame with z upward. `accel_mps2` is
    the specific force in the sensor's axes: at rest 9.8 m/s^2, pointing upward. Both are None if not measured.
    """

    stamp_ns: int
    frame_id: str
    wz_radps: float
    wx_radps: float = 0.0
    wy_radps: float = 0.0
    quat_wxyz: tuple[float, float, float, float] | None = None
    accel_mps2: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class WheelTicks:
    """Accumulated angles of the left and right wheel; positive forwards."""

    stamp_ns: int
    frame_id: str
    left_rad: float
    right_rad: float


@dataclass(frozen=True, slots=True)
class Range:
    """One reading of a single-beam ranger on a servo; at `bearing_rad` = 0 it points along the x axis of its frame."""

    stamp_ns: int
    frame_id: str  # also the sensor's name
    bearing_rad: float
    range_m: float
    range_min_m: float
    range_max_m: float


@dataclass(frozen=True, slots=True)
class AbsolutePose:
    """An absolute pose `(3,)` in the map frame, as external trackers measure it, and its covariance `(3, 3)` over x, y, yaw."""

    stamp_ns: int
    frame_id: str
    pose: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Image:
    """Pixels `(rows, cols)` grey or `(rows, cols, 3)` RGB, uint8; rectified unless `is_raw`."""

    stamp_ns: int
    frame_id: str
    pixels: NDArray[np.uint8]
    camera: str = ""
    is_raw: bool = False


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Left and right grey image taken at the same time, `(rows, cols)` uint8; rectified unless `is_raw`."""

    stamp_ns: int
    frame_id: str
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    is_raw: bool = False


@dataclass(frozen=True, slots=True)
class Disparity:
    """Disparity image `(rows, cols)` float32 in pixels, NaN where there is no match."""

    stamp_ns: int
    frame_id: str
    disparity_px: NDArray[np.float32]
    focal_px: float
    baseline_m: float
    camera: str = ""


@dataclass(frozen=True, slots=True)
class DepthImage:
    """Depth along the optical axis `(rows, cols)` float32 in metres, NaN where there is none."""

    stamp_ns: int
    frame_id: str
    depth_m: NDArray[np.float32]
    camera: str = ""


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """Calibration: K `(3, 3)`, projection P `(3, 4)`, distortion coefficients D `(n,)` in OpenCV's order.

    R `(3, 3)` is the rectifying rotation, `distortion_model` as in ROS (plumb_bob, rational_polynomial, equidistant).
    """

    stamp_ns: int
    frame_id: str
    width_px: int
    height_px: int
    K: NDArray[np.float64]
    P: NDArray[np.float64]
    D: NDArray[np.float64]
    camera: str = ""
    R: NDArray[np.float64] = field(default_factory=lambda: readonly(np.eye(3), np.float64))
    distortion_model: str = "plumb_bob"


@dataclass(frozen=True, slots=True)
class TagInventory:
    """All tags that one antenna read in one inventory round. Empty rounds are messages too: they show that no tag answered."""

    stamp_ns: int
    frame_id: str
    antenna: str
    tag_ids: tuple[str, ...]
    rssi_dbm: tuple[float, ...]


Event: TypeAlias = (
    Transform
    | LaserScan
    | PointCloud
    | Odometry
    | Imu
    | WheelTicks
    | Range
    | AbsolutePose
    | Image
    | StereoPair
    | Disparity
    | DepthImage
    | CameraInfo
    | TagInventory
)
