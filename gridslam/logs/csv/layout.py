"""What `log.yaml` says about a folder of CSV files."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field, field_validator

from gridslam.config.base import StrictModel
from gridslam.logs.stamps import END_S, NS_PER_S

CsvKind: TypeAlias = Literal[
    "scan",
    "odom",
    "imu",
    "wheels",
    "range",
    "fix",
    "tags",
    "image",
    "depth",
    "disparity",
    "camera_info",
    "tf",
    "truth",
]
Unit: TypeAlias = Literal[
    "m",
    "cm",
    "mm",
    "rad",
    "deg",
    "rad_clockwise",
    "deg_clockwise",
    "s",
    "ms",
    "us",
    "ns",
    "m/s",
    "rad/s",
    "deg/s",
]


_LENGTHS = frozenset({"m", "cm", "mm"})
_ANGLES = frozenset({"rad", "deg", "rad_clockwise", "deg_clockwise"})
_TIMES = frozenset({"s", "ms", "us", "ns"})
UNITS_OF: dict[str, frozenset[str]] = {
    **dict.fromkeys(("stamp", "time_increment"), _TIMES),
    **dict.fromkeys(("x", "y", "z", "r", "range", "range_min", "range_max", "baseline"), _LENGTHS),
    **dict.fromkeys(("yaw", "bearing", "angle_min", "angle_increment", "left", "right"), _ANGLES),
    "vx": _LENGTHS | {"m/s"},  # a length or an angle counts as one in a second
    "wz": _ANGLES | {"rad/s", "deg/s"},
}
"""The units that a column may be in; columns that are not here have none."""


class FrameExtrinsics(StrictModel):
    """Pose of a frame: x, y, z (m) and either roll, pitch, yaw (rad) or a quaternion w, x, y, z."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    quat_wxyz: tuple[float, float, float, float] | None = None
    parent: str | None = Field(None, description="absent: the base frame")


class RowStamps(StrictModel):
    """Stamps of a table without a time column: `start_s + row * period_s`."""

    start_s: float = Field(0.0, ge=0.0, lt=END_S)
    period_s: float = Field(ge=1.0 / NS_PER_S, lt=END_S)


class CsvStream(StrictModel):
    """One CSV file as one stream. Columns go by our names (see COLUMNS below)."""

    kind: CsvKind
    file: str = Field(min_length=1, description="path inside the folder")
    topic: str | None = Field(None, description="name for log.topics; absent: the file's name")
    columns: dict[str, str] = Field(default_factory=dict, description="our name: the file's name")
    units: dict[str, Unit] = Field(default_factory=dict, description="our name: the file's unit")
    constants: dict[str, float | str] = Field(
        default_factory=dict, description="our name: one value for every row, in the file's unit"
    )
    invalid: list[float] = Field(
        default_factory=list, description="range readings, in the file's unit, that mean no return"
    )
    invalid_from: float | None = Field(
        None, description="range readings from here on, in the file's unit, mean no return"
    )
    row_stamps: RowStamps | None = Field(None, description="for a file without a time column")
    frame: str | None = Field(None, description="frame_id of the messages; absent: by kind")
    child_frame: str | None = Field(None, description="odometry's child frame; absent: base_link")
    delimiter: str = Field(",", min_length=1, max_length=1)

    @field_validator("columns", "units", "constants")
    @classmethod
    def _known_columns(cls, value: dict[str, object]) -> dict[str, object]:
        known = {name for names in COLUMNS.values() for name in (*names.required, *names.optional)}
        unknown = sorted(set(value) - known - {"r"})
        if unknown:
            raise ValueError(
                f"no column {unknown[0]!r}; columns are {', '.join(sorted(known))}, and r for ranges"
            )
        return value

    @field_validator("units")
    @classmethod
    def _fitting_units(cls, value: dict[str, Unit]) -> dict[str, Unit]:
        for name, unit in value.items():
            fitting = UNITS_OF.get(name, frozenset())
            if unit not in fitting:
                raise ValueError(f"{name} in {unit}: expected {', '.join(sorted(fitting)) or 'no unit'}")
        return value


class CsvLayout(StrictModel):
    """A folder of CSV files. Without `streams`: the files with the default names."""

    version: Literal[1] = 1
    base_frame: str | None = None
    streams: list[CsvStream] = Field(default_factory=list)
    extrinsics: dict[str, FrameExtrinsics] = Field(default_factory=dict)


class Columns(StrictModel):
    """Column names of one kind of table; a scan's ranges r0, r1, ... come after them."""

    required: tuple[str, ...]
    optional: tuple[str, ...] = ()


_POSE = ("x", "y", "yaw")
_MATRICES = (*(f"k{i}" for i in range(9)), *(f"p{i}" for i in range(12)))
COLUMNS: dict[str, Columns] = {
    "scan": Columns(
        required=("angle_min", "angle_increment", "range_min", "range_max"),
        optional=("time_increment", "frame"),
    ),
    "odom": Columns(required=_POSE, optional=("vx", "wz", "frame", "child_frame")),
    "truth": Columns(required=_POSE, optional=("frame", "child_frame")),
    "imu": Columns(required=("wz",), optional=("frame",)),
    "wheels": Columns(required=("left", "right"), optional=("frame",)),
    "range": Columns(required=("sensor", "bearing", "range", "range_min", "range_max")),
    "fix": Columns(
        required=(*_POSE, "var_x", "var_y", "var_yaw"), optional=("cov_xy", "cov_xyaw", "cov_yyaw", "frame")
    ),
    "tags": Columns(required=("antenna", "tag_id", "rssi"), optional=("frame",)),
    "image": Columns(required=("camera", "file"), optional=("frame",)),
    "depth": Columns(required=("camera", "file"), optional=("frame",)),
    "disparity": Columns(required=("camera", "file", "focal", "baseline"), optional=("frame",)),
    "camera_info": Columns(
        required=("camera", "width", "height", *_MATRICES),
        optional=(*(f"d{i}" for i in range(14)), "frame"),
    ),
    "tf": Columns(required=("parent", "child", "x", "y", "z", "qw", "qx", "qy", "qz")),
}
# "stamp" belongs to every kind; it may be missing where row_stamps are given.
COLUMNS["stamp"] = Columns(required=("stamp",))
DEFAULT_FILES = {kind: f"{kind}.csv" for kind in COLUMNS if kind != "stamp"}
DEFAULT_FRAMES = {
    "scan": "laser",
    "odom": "odom",
    "imu": "imu",
    "wheels": "base_link",
    "fix": "map",
    "truth": "map",
}
