"""The table of message kinds: one row for each stream kind that a log may have.

A new kind takes three files: its class in `core/messages.py`, its codec in `logs/codecs/`, and a row here.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Event,
    Image,
    Imu,
    LaserScan,
    Odometry,
    PointCloud,
    Range,
    StereoPair,
    TagInventory,
    Transform,
    WheelTicks,
)
from gridslam.logs.codecs import (
    camera_info,
    cloud,
    depth,
    disparity,
    image,
    imu,
    odometry,
    pose,
    ranger,
    scan,
    tags,
    transform,
    wheels,
)
from gridslam.logs.message_kind import CsvTableKind, FromFoxglove, FromRos, MessageKind
from gridslam.logs.skips import SkipReason

TRUTH_TOPIC = "/ground_truth"
_POSE = ("x", "y", "yaw")
_QUATERNION = ("qw", "qx", "qy", "qz")
_COVARIANCE = ("var_x", "var_y", "var_yaw")
_MATRICES = (*(f"k{i}" for i in range(9)), *(f"p{i}" for i in range(12)))
_ROTATION = tuple(f"r{i}" for i in range(9))
_DISTORTION = tuple(f"d{i}" for i in range(camera_info.DISTORTION_COLUMNS))

# In order of precedence: at equal stamps, what a scan needs comes before it.
_KINDS = (
    MessageKind(
        "tf",
        Transform,
        ros={"tf2_msgs/msg/TFMessage": None, "tf/msg/tfMessage": None},
        foxglove={"foxglove.FrameTransform": None, "foxglove.FrameTransforms": None},
        to_ros=transform.to_ros,
        csv=CsvTableKind(
            transform.from_csv,
            transform.to_csv,
            required=("parent", "child", "x", "y", "z", *_QUATERNION),
            default_frame="tf",
            rows_name_frames=True,
        ),
        unusable_reason=transform.unusable_reason,
        is_named_by_camera=True,
    ),
    MessageKind(
        "camera_info",
        CameraInfo,
        ros={"sensor_msgs/msg/CameraInfo": camera_info.from_ros},
        foxglove={"foxglove.CameraCalibration": camera_info.from_foxglove},
        to_ros=camera_info.to_ros,
        csv=CsvTableKind(
            camera_info.from_csv,
            camera_info.to_csv,
            required=("camera", "width", "height", *_MATRICES),
            optional=(*_DISTORTION, *_ROTATION, "model", "d_rest", "frame"),
            default_frame="camera_info",
            rows_name_frames=True,
        ),
        unusable_reason=camera_info.unusable_reason,
        is_sensor=True,
        is_named_by_camera=True,
    ),
    MessageKind(
        "odom",
        Odometry,
        ros={"nav_msgs/msg/Odometry": odometry.from_ros},
        to_ros=odometry.to_ros,
        csv=CsvTableKind(
            odometry.from_csv,
            odometry.to_csv,
            required=_POSE,
            optional=("vx", "wz", "frame", "child_frame"),
            default_frame="odom",
        ),
        unusable_reason=odometry.unusable_reason,
        is_single=True,
    ),
    MessageKind(
        "imu",
        Imu,
        ros={"sensor_msgs/msg/Imu": imu.from_ros},
        to_ros=imu.to_ros,
        csv=CsvTableKind(
            imu.from_csv,
            imu.to_csv,
            required=("wz",),
            optional=("wx", "wy", *_QUATERNION, "ax", "ay", "az", "frame"),
            default_frame="imu",
        ),
        unusable_reason=imu.unusable_reason,
        is_single=True,
        is_sensor=True,
    ),
    MessageKind(
        "wheels",
        WheelTicks,
        ros={"sensor_msgs/msg/JointState": None},
        to_ros=wheels.to_ros,
        csv=CsvTableKind(
            wheels.from_csv,
            wheels.to_csv,
            required=("left", "right"),
            optional=("frame",),
            default_frame="base_link",
        ),
        unusable_reason=wheels.unusable_reason,
        is_single=True,
    ),
    MessageKind(
        "pose",
        AbsolutePose,
        ros={"geometry_msgs/msg/PoseWithCovarianceStamped": pose.from_ros},
        to_ros=pose.to_ros,
        csv=CsvTableKind(
            pose.from_csv,
            pose.to_csv,
            required=(*_POSE, "var_x", "var_y", "var_yaw"),
            optional=("cov_xy", "cov_xyaw", "cov_yyaw", "frame"),
            default_frame="map",
        ),
        unusable_reason=pose.unusable_reason,
        is_single=True,
    ),
    MessageKind(
        "tags",
        TagInventory,
        ros={"gridslam_msgs/msg/TagInventory": tags.from_ros},
        to_ros=tags.to_ros,
        csv=CsvTableKind(
            tags.from_csv,
            tags.to_csv,
            required=("antenna", "tag_id", "rssi"),
            optional=("frame",),
            default_frame="tags",
            rows_name_frames=True,
        ),
        unusable_reason=tags.unusable_reason,
        is_sensor=True,
    ),
    MessageKind(
        "range",
        Range,
        ros={"sensor_msgs/msg/Range": None},
        to_ros=ranger.to_ros,
        csv=CsvTableKind(
            ranger.from_csv,
            ranger.to_csv,
            required=("sensor", "bearing", "range", "range_min", "range_max"),
            default_frame="range",
            frame_column="sensor",
            rows_name_frames=True,
        ),
        unusable_reason=ranger.unusable_reason,
        is_sensor=True,
    ),
    MessageKind(
        "scan",
        LaserScan,
        ros={
            "sensor_msgs/msg/LaserScan": scan.from_ros,
            "sensor_msgs/msg/MultiEchoLaserScan": scan.from_multi_echo,
        },
        foxglove={"foxglove.LaserScan": scan.from_foxglove},
        to_ros=scan.to_ros,
        csv=CsvTableKind(
            scan.from_csv,
            scan.to_csv,
            required=("angle_min", "angle_increment", "range_min", "range_max"),
            optional=("time_increment", "frame"),
            default_frame="laser",
            has_ranges=True,
        ),
        unusable_reason=scan.unusable_reason,
        is_single=True,
        is_sensor=True,
    ),
    MessageKind(
        "cloud",
        PointCloud,
        ros={
            "sensor_msgs/msg/PointCloud2": cloud.from_ros,
            "livox_ros_driver/msg/CustomMsg": cloud.from_livox,
            "livox_ros_driver2/msg/CustomMsg": cloud.from_livox,
        },
        to_ros=cloud.to_ros,
        unusable_reason=cloud.unusable_reason,
        is_sensor=True,
    ),
    MessageKind("stereo", StereoPair, to_ros=image.stereo_to_ros, is_sensor=True),
    MessageKind(
        "disparity",
        Disparity,
        ros={"stereo_msgs/msg/DisparityImage": disparity.from_ros},
        to_ros=disparity.to_ros,
        csv=CsvTableKind(
            disparity.from_csv,
            disparity.to_csv,
            required=("camera", "file", "focal", "baseline"),
            optional=("frame",),
            default_frame="disparity",
            rows_name_frames=True,
            has_pictures=True,
        ),
        unusable_reason=disparity.unusable_reason,
        is_sensor=True,
        is_named_by_camera=True,
    ),
    MessageKind(
        "depth",
        DepthImage,
        to_ros=depth.to_ros,
        csv=CsvTableKind(
            depth.from_csv,
            depth.to_csv,
            required=("camera", "file"),
            optional=("frame",),
            default_frame="depth",
            rows_name_frames=True,
            has_pictures=True,
        ),
        is_sensor=True,
        is_named_by_camera=True,
    ),
    MessageKind(
        "image",
        Image,
        ros={
            "sensor_msgs/msg/Image": image.from_ros,
            "sensor_msgs/msg/CompressedImage": image.from_compressed,
        },
        foxglove={
            "foxglove.RawImage": image.from_foxglove,
            "foxglove.CompressedImage": image.from_foxglove_compressed,
        },
        to_ros=image.to_ros,
        csv=CsvTableKind(
            image.from_csv,
            image.to_csv,
            required=("camera", "file"),
            optional=("raw", "frame"),
            default_frame="image",
            rows_name_frames=True,
            has_pictures=True,
        ),
        is_sensor=True,
        is_named_by_camera=True,
    ),
    MessageKind(
        "truth",
        csv=CsvTableKind(
            odometry.from_csv,
            odometry.to_csv,
            required=_POSE,
            optional=("vx", "wz", "frame", "child_frame"),
            default_frame="map",
        ),
        unusable_reason=odometry.unusable_reason,
        is_event=False,
    ),
    MessageKind(
        "pose_stamped",
        ros={"geometry_msgs/msg/PoseStamped": odometry.from_pose_stamped},
        foxglove={"foxglove.PoseInFrame": odometry.from_foxglove},
        is_event=False,
    ),
    MessageKind("joints", is_event=False),
    MessageKind("other", is_event=False),
)

KINDS: Mapping[str, MessageKind] = MappingProxyType({kind.name: kind for kind in _KINDS})
PRECEDENCE: Mapping[str, int] = MappingProxyType({name: place for place, name in enumerate(KINDS)})
EVENT_KINDS = tuple(kind.name for kind in _KINDS if kind.is_event)
CSV_KINDS: Mapping[str, CsvTableKind] = MappingProxyType(
    {kind.name: kind.csv for kind in _KINDS if kind.csv is not None}
)
WITHOUT_TABLE = frozenset({"cloud"})  # events that a CSV folder cannot hold
OLDER_NAMES: Mapping[str, str] = MappingProxyType({"fix": "pose"})  # accepted where files name a kind

_OF_MESSAGE = {kind.message: kind for kind in _KINDS if kind.message is not None}
_OF_ROS_TYPE = {name: kind for kind in _KINDS for name in kind.ros}
_OF_FOXGLOVE_TYPE = {name: kind for kind in _KINDS for name in kind.foxglove}


def kind_of_event(event: Event) -> MessageKind:
    """The kind of an event."""
    return _OF_MESSAGE[type(event)]


def kind_of_ros_type(name: str) -> str:
    """The kind that messages of a ROS type (`package/msg/Type`) serve as; `other` for a type that nothing uses."""
    kind = _OF_ROS_TYPE.get(name)
    return "other" if kind is None else kind.name


def kind_of_foxglove_type(name: str) -> str:
    """The kind that messages of a Foxglove type serve as; empty for other types."""
    kind = _OF_FOXGLOVE_TYPE.get(name)
    return "" if kind is None else kind.name


def ros_converter(name: str) -> FromRos | None:
    """The conversion of decoded messages of a ROS type; None where the kind has none of its own."""
    kind = _OF_ROS_TYPE.get(name)
    return None if kind is None else kind.ros[name]


def foxglove_converter(name: str) -> FromFoxglove | None:
    """The conversion of decoded messages of a Foxglove type; None where the kind has none of its own."""
    kind = _OF_FOXGLOVE_TYPE.get(name)
    return None if kind is None else kind.foxglove[name]


def unusable_reason(event: Event) -> SkipReason | None:
    """The reason why no method can use the event; None where it can."""
    check = _UNUSABLE_REASONS.get(type(event))
    return check(event) if check else None


_UNUSABLE_REASONS = {
    kind.message: kind.unusable_reason
    for kind in _KINDS
    if kind.message is not None and kind.unusable_reason is not None
}
