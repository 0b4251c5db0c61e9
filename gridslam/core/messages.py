"""Messages of sensors, independent of the file that they were read from.

Every message carries `stamp_ns` (integer nanoseconds, never rounded) and `frame_id`. Arrays are read-only. The values
of a message do not depend on the container it was read from: what ROS stores as float32 is kept to float32 precision
in every format, and yaw angles are kept to 2^-40 rad, so that a log and its conversion give the same run.
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
_SURELY_FLOAT32 = 3.4e38  # a little less than the largest float32


def canonical_yaw(yaw_rad: float) -> float:
    """Yaw rounded to 2^-40 rad (1e-12): a detour through a quaternion gives the same number back.

    Rounding never leads out of [-pi, pi], where the quaternion would come back from the other side.
    """
    if not math.isfinite(yaw_rad):
        return yaw_rad
    steps = round(yaw_rad * _YAW_STEPS_PER_RAD)
    if abs(steps) > _LARGEST_YAW_STEPS and abs(yaw_rad) <= math.pi:
        steps = _LARGEST_YAW_STEPS if steps > 0 else -_LARGEST_YAW_STEPS
    return steps / _YAW_STEPS_PER_RAD


def as_float32(value: float) -> float:
    """The value as ROS would store it in a float32 field; infinite where it is too large for one."""
    if abs(value) < _SURELY_FLOAT32:
        return float(np.float32(value))
    with np.errstate(over="ignore"):  # this takes as long as all the rest
        return float(np.float32(value))


def readonly(values: ArrayLike, dtype: type[Scalar]) -> NDArray[Scalar]:
    """A contiguous read-only array of the given type and the same shape (a view where no conversion is needed)."""
    with np.errstate(over="ignore"):  # a double that is too large for a float32 is infinite
        array = np.ascontiguousarray(values, dtype=dtype).view()
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True)
class Transform:
    """T_parent_child: the pose of the child frame in the parent frame (static ones give a sensor's extrinsics)."""

    stamp_ns: int
    frame_id: str  # parent
    child_frame_id: str
    translation_m: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    is_static: bool = False


@dataclass(frozen=True, slots=True)
class LaserScan:
    """One sweep of a planar lidar: beam i points to angle_min_rad + i * angle_increment_rad in the sensor's frame.

    `ranges_m` is float32 `(n,)` as recorded: values outside [range_min_m, range_max_m], NaN and infinities are still there.
    `angle_max_rad` is what the message says of its last beam; NaN where it says nothing. `has_uncertain_sense`: the message
    contradicts itself about the sense in which its beams turn. `other_increment_rad` is the increment that it states where
    another one follows from its angles. `is_of_cloud`: its beams are points of a cloud at any height.
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
    """T_odom_base with, where the log has them, velocities in the robot's frame (NaN where it has not)."""

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
        """Whether the pose is a pose: no number of it is NaN or infinite."""
        return math.isfinite(self.x_m) and math.isfinite(self.y_m) and math.isfinite(self.yaw_rad)


@dataclass(frozen=True, slots=True)
class Imu:
    """Turn rates about the sensor's axes (`wz_radps`: the yaw rate of a level one), and what it knows of the vertical.

    `quat_wxyz` is its orientation in a level frame, `accel_mps2` its specific force, upward 9.8 m/s^2 at rest; None where not
    measured.
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
    """Accumulated angles of the left and right wheel."""

    stamp_ns: int
    frame_id: str
    left_rad: float
    right_rad: float


@dataclass(frozen=True, slots=True)
class Range:
    """One reading of a single-beam ranger at a servo bearing (0 = the sensor's extrinsics direction)."""

    stamp_ns: int
    frame_id: str  # also the sensor's name
    bearing_rad: float
    range_m: float
    range_min_m: float
    range_max_m: float


@dataclass(frozen=True, slots=True)
class AbsolutePose:
    """An absolute pose in the map frame from outside, with its covariance `(3, 3)` over x, y, yaw."""

    stamp_ns: int
    frame_id: str
    pose: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Image:
    """Pixels `(rows, cols)` grey or `(rows, cols, 3)` RGB, uint8; `is_raw`: as the camera took them, not rectified."""

    stamp_ns: int
    frame_id: str
    pixels: NDArray[np.uint8]
    camera: str = ""
    is_raw: bool = False


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Grey images of one moment, left and right, `(rows, cols)` uint8; rectified unless `is_raw`."""

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
    """All tags that one antenna read in one round; an empty round is information as well."""

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
