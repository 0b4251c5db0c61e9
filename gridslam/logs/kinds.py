"""The table of message kinds: one row for each stream kind that a log may have.

A new kind takes three files: its class in `core/messages.py`, its codec in `logs/codecs/`, and a row here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
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
from gridslam.logs.checks.depth_units import DepthUnits
from gridslam.logs.checks.scan_units import CloudUnits
from gridslam.logs.checks.wheel_revolutions import WheelRevolutions
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
from gridslam.logs.message_kind import (
    ANGLES,
    LENGTHS,
    RATES,
    SPEEDS,
    TIMES,
    CsvTableKind,
    MessageKind,
    RowGroups,
)

TRUTH_TOPIC = "/ground_truth"  # where simulators and motion capture publish the true pose
_POSE = ("x", "y", "yaw")
_UNITS_OF_POSE = {"x": LENGTHS, "y": LENGTHS, "yaw": ANGLES}
_QUATERNION = ("qw", "qx", "qy", "qz")
_MATRICES = (*(f"k{i}" for i in range(9)), *(f"p{i}" for i in range(12)))
_ROTATION = tuple(f"r{i}" for i in range(9))
_DISTORTION = tuple(f"d{i}" for i in range(camera_info.DISTORTION_COLUMNS))
_ODOMETRY_TABLE = CsvTableKind(
    odometry.from_csv,
    odometry.to_csv,
    required=_POSE,
    optional=("vx", "wz", "frame", "child_frame"),
    default_frame="odom",
    units={**_UNITS_OF_POSE, "vx": SPEEDS, "wz": RATES},
)

# In order of precedence: at equal stamps, what a scan needs comes before it.
KINDS_IN_ORDER = (
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
            texts=("parent", "child"),
            units=dict.fromkeys(("x", "y", "z"), LENGTHS),
            frame_column="",
            rows_name_frames=True,
            apart_by=("frame_id", "child_frame_id"),
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
            texts=("camera", "model"),
            lists=("d_rest",),
            naming_column="camera",
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
        shared_foxglove={"foxglove.PoseInFrame": odometry.from_foxglove},
        claims=odometry.is_odometry,
        to_ros=odometry.to_ros,
        csv=_ODOMETRY_TABLE,
        unusable_reason=odometry.unusable_reason,
        several="one",
        may_be_truth=True,
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
            units={"wz": RATES},
        ),
        unusable_reason=imu.unusable_reason,
        several="densest",
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
            units=dict.fromkeys(("left", "right"), ANGLES),
        ),
        unusable_reason=wheels.unusable_reason,
        repair=WheelRevolutions,
        several="one",
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
            units=_UNITS_OF_POSE,
        ),
        unusable_reason=pose.unusable_reason,
        several="one",
        may_be_truth=True,
    ),
    MessageKind(
        "tags",
        TagInventory,
        ros={"gridslam_msgs/msg/TagInventory": tags.from_ros},
        definitions={"gridslam_msgs/msg/TagInventory": tags.DEFINITION},
        to_ros=tags.to_ros,
        csv=CsvTableKind(
            tags.from_csv,
            tags.to_csv,
            required=("antenna", "tag_id", "rssi"),
            optional=("frame",),
            default_frame="tags",
            texts=("antenna", "tag_id"),
            naming_column="antenna",
            rows_name_frames=True,
            groups=RowGroups(by="antenna", item="tag_id"),
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
            texts=("sensor",),
            units={"bearing": ANGLES, **dict.fromkeys(("range", "range_min", "range_max"), LENGTHS)},
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
            units={
                "time_increment": TIMES,
                **dict.fromkeys(("angle_min", "angle_increment"), ANGLES),
                **dict.fromkeys(("r", "range_min", "range_max"), LENGTHS),
            },
            has_ranges=True,
        ),
        unusable_reason=scan.unusable_reason,
        several="of_own_frames",
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
        repair=CloudUnits,
        is_sensor=True,
    ),
    MessageKind(
        "stereo",
        StereoPair,
        to_ros=image.stereo_to_ros,
        csv_parts=image.stereo_to_images,
        is_sensor=True,
    ),
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
            texts=("camera", "file"),
            units={"baseline": LENGTHS},
            naming_column="camera",
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
        shared_ros={
            "sensor_msgs/msg/Image": depth.from_ros,
            "sensor_msgs/msg/CompressedImage": depth.from_compressed,
        },
        shared_foxglove={"foxglove.RawImage": depth.from_foxglove},
        claims=depth.is_depth,
        repair=DepthUnits,
        to_ros=depth.to_ros,
        csv=CsvTableKind(
            depth.from_csv,
            depth.to_csv,
            required=("camera", "file"),
            optional=("frame",),
            default_frame="depth",
            texts=("camera", "file"),
            naming_column="camera",
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
            texts=("camera", "file"),
            naming_column="camera",
            rows_name_frames=True,
            has_pictures=True,
        ),
        is_sensor=True,
        is_named_by_camera=True,
    ),
    MessageKind(
        "truth",
        csv=replace(_ODOMETRY_TABLE, default_frame="map"),
        unusable_reason=odometry.unusable_reason,
        may_be_truth=True,
        is_event=False,
    ),
    MessageKind(
        "pose_stamped",
        ros={"geometry_msgs/msg/PoseStamped": odometry.from_pose_stamped},
        foxglove={"foxglove.PoseInFrame": odometry.from_foxglove},
        may_be_truth=True,
        is_event=False,
    ),
    MessageKind("joints", is_event=False),
    MessageKind("other", is_event=False),
)

KINDS: Mapping[str, MessageKind] = MappingProxyType({kind.name: kind for kind in KINDS_IN_ORDER})
PRECEDENCE: Mapping[str, int] = MappingProxyType({name: place for place, name in enumerate(KINDS)})
EVENT_KINDS = tuple(kind.name for kind in KINDS_IN_ORDER if kind.is_event)
CSV_KINDS: Mapping[str, CsvTableKind] = MappingProxyType(
    {kind.name: kind.csv for kind in KINDS_IN_ORDER if kind.csv is not None}
)
# Events that a CSV folder cannot hold.
WITHOUT_TABLE = frozenset(
    k.name for k in KINDS_IN_ORDER if k.is_event and k.csv is None and k.csv_parts is None
)
UNITS_OF: Mapping[str, frozenset[str]] = MappingProxyType(
    {"stamp": TIMES}
    | {column: units for table in CSV_KINDS.values() for column, units in table.units.items()}
)
"""The units that a column may have; columns that are missing here have none."""
ROS_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {name: text for kind in KINDS_IN_ORDER for name, text in kind.definitions.items()}
)
"""Definitions of our own message types by name."""
OLDER_NAMES: Mapping[str, str] = MappingProxyType({"fix": "pose"})  # accepted where files name a kind
