"""Message types: which definitions are standard, and decoders from the definitions that a log carries."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from gridslam.logs.kinds import ROS_DEFINITIONS
from gridslam.logs.ros.container import Schema
from gridslam.logs.ros.definitions import checked_types, is_type_name, refuse_unbounded
from gridslam.logs.ros.idl import types_of_idl

if TYPE_CHECKING:
    from gridslam.logs.ros.type_store import BoundedTypestore

MAX_SCHEMA_BYTES = 1 << 16  # the longest schemas of ROS 2 have 20 kB
# Of one log; there are some 20 types that anything uses, and each may have changed within a recording
MAX_DEFINITIONS = 64

# The fields that the hand-written decoders in `fast_cdr` expect.
_STANDARD_FIELDS = {
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp|string frame_id",
    "builtin_interfaces/msg/Time": "int32 sec|uint32 nanosec",
    "sensor_msgs/msg/LaserScan": "std_msgs/Header header|float32 angle_min|float32 angle_max|"
    "float32 angle_increment|float32 time_increment|float32 scan_time|float32 range_min|float32 range_max|"
    "float32[] ranges|float32[] intensities",
    "nav_msgs/msg/Odometry": "std_msgs/Header header|string child_frame_id|"
    "geometry_msgs/PoseWithCovariance pose|geometry_msgs/TwistWithCovariance twist",
    "sensor_msgs/msg/Imu": "std_msgs/Header header|geometry_msgs/Quaternion orientation|"
    "float64[9] orientation_covariance|geometry_msgs/Vector3 angular_velocity|"
    "float64[9] angular_velocity_covariance|geometry_msgs/Vector3 linear_acceleration|"
    "float64[9] linear_acceleration_covariance",
    "sensor_msgs/msg/JointState": "std_msgs/Header header|string[] name|float64[] position|float64[] velocity|"
    "float64[] effort",
    "sensor_msgs/msg/Range": "std_msgs/Header header|uint8 radiation_type|float32 field_of_view|float32 min_range|"
    "float32 max_range|float32 range",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "geometry_msgs/msg/TransformStamped": "std_msgs/Header header|string child_frame_id|"
    "geometry_msgs/Transform transform",
    "geometry_msgs/msg/Transform": "geometry_msgs/Vector3 translation|geometry_msgs/Quaternion rotation",
    "geometry_msgs/msg/PoseWithCovariance": "geometry_msgs/Pose pose|float64[36] covariance",
    "geometry_msgs/msg/TwistWithCovariance": "geometry_msgs/Twist twist|float64[36] covariance",
    "geometry_msgs/msg/Pose": "geometry_msgs/Point position|geometry_msgs/Quaternion orientation",
    "geometry_msgs/msg/Twist": "geometry_msgs/Vector3 linear|geometry_msgs/Vector3 angular",
    "geometry_msgs/msg/Point": "float64 x|float64 y|float64 z",
    "geometry_msgs/msg/Vector3": "float64 x|float64 y|float64 z",
    "geometry_msgs/msg/Quaternion": "float64 x|float64 y|float64 z|float64 w",
}

# What later releases have appended to them.
_APPENDED_FIELDS = {"sensor_msgs/msg/Range": "|float32 variance"}


def full_name(name: str) -> str:
    """The name of a type as `package/msg/Type`, given any spelling of it."""
    parts = [p for p in name.replace("::", "/").split("/") if p]
    return f"{parts[0]}/msg/{parts[-1]}" if len(parts) >= 2 else name


@lru_cache(maxsize=256)
def is_standard(schema: Schema) -> bool:
    """Whether the types of a ros2msg schema that `ros/fast_cdr.py` reads have exactly the standard fields in order."""
    if schema.encoding != "ros2msg" or len(schema.data) > MAX_SCHEMA_BYTES:
        return False
    try:
        text = schema.data.decode()
    except UnicodeDecodeError:
        return False
    sections = re.split(r"(?m)^=+\s*$", text)
    found = {full_name(schema.name): _fields(sections[0])}
    for section in sections[1:]:
        title, _, body = section.lstrip().partition("\n")
        found[full_name(title.removeprefix("MSG:").strip())] = _fields(body)
    found.setdefault("builtin_interfaces/msg/Time", _STANDARD_FIELDS["builtin_interfaces/msg/Time"])
    known = {name: fields for name, fields in found.items() if name in _STANDARD_FIELDS}
    return full_name(schema.name) in known and all(
        fields.removesuffix(_APPENDED_FIELDS.get(name, "")) == _STANDARD_FIELDS[name]
        for name, fields in known.items()
    )


def _fields(text: str) -> str:
    """The fields of a definition without comments, constants and defaults, types by their short name."""
    lines = []
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if len(words) >= 2 and "=" not in line.split("#", 1)[0]:
            lines.append(f"{words[0].replace('/msg/', '/')} {words[1]}")
    return "|".join(lines)


@lru_cache(maxsize=256)
def decoder_of(schema: Schema | None, name: str) -> Callable[[bytes], Any]:
    """The function that decodes a type from CDR bytes to an object. It raises ValueError for bytes that are not such a message.

    Raises ValueError: the schema cannot be understood, or has names that no ROS definition has.
    """
    from rosbags.typesys import TypesysError

    from gridslam.logs.ros.type_store import BoundedTypestore

    if schema is None or not schema.data.strip():
        if name not in ros2_types().fielddefs:
            raise ValueError(f"{name}: the log has no definition of this type")
        return _decoder(BoundedTypestore(ros2_types()), name)
    if not is_type_name(name):
        raise ValueError("not the name of a message type")
    if len(schema.data) > MAX_SCHEMA_BYTES:
        raise ValueError(f"{name}: its definition is larger than any real one")
    store = BoundedTypestore()
    try:
        types = {**_time_types(), **checked_types(_types_of(schema.data.decode(), schema.encoding, name))}
        refuse_unbounded(types, name)
        store.register(types)
    except (TypesysError, KeyError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(f"{name}: its definition cannot be understood ({error})") from error
    return _decoder(store, name)


def _types_of(text: str, encoding: str, name: str) -> dict[str, Any]:
    from rosbags.typesys import get_types_from_msg

    if encoding != "ros2idl":
        return dict(get_types_from_msg(text, name))
    types: dict[str, Any] = {}
    for section in re.split(r"(?m)^=+\s*$", text):
        types.update(types_of_idl(re.sub(r"(?m)^IDL: .*$", "", section)))
    return types


def _decoder(store: BoundedTypestore, name: str) -> Callable[[bytes], Any]:
    from rosbags.serde import SerdeError

    def decode(data: bytes) -> Any:
        try:
            return store.deserialize_cdr(data, name)
        except (SerdeError, AssertionError, MemoryError) as error:
            raise ValueError(f"not a {name}") from error

    return decode


@cache
def _time_types() -> dict[str, Any]:
    """The types Time and Duration, which definitions use without defining them."""
    return {
        name: fields
        for name, fields in ros2_types().fielddefs.items()
        if name.startswith("builtin_interfaces/")
    }


@cache
def ros2_types() -> Any:
    """The types of ROS 2 Humble, and our own."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in ROS_DEFINITIONS.items():
        store.register(get_types_from_msg(definition, name))
    return store
