"""What `log.yaml` says about a folder of CSV files."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field

from gridslam.config.base import StrictModel

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
Unit: TypeAlias = Literal["m", "cm", "mm", "rad", "deg", "s", "ms", "us", "ns", "mps", "radps", "degps"]


class FrameMounting(StrictModel):
    """T_base_sensor of one frame: x, y, z (m) and either roll, pitch, yaw (rad) or a quaternion w, x, y, z."""

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

    start_s: float = 0.0
    period_s: float = Field(gt=0.0)


class CsvStream(StrictModel):
    """One CSV file as one stream."""

    kind: CsvKind
    file: str = Field(min_length=1, description="path inside the folder")
    topic: str | None = Field(None, description="name shown and used by log.topics; absent: the file's name")
    columns: dict[str, str] = Field(
        default_factory=dict, description="our column name: the file's column name"
    )
    units: dict[str, Unit] = Field(default_factory=dict, description="our column name: the file's unit")
    constants: dict[str, float | str] = Field(
        default_factory=dict, description="our column name: a value for every row"
    )
    invalid: list[float] = Field(
        default_factory=list,
        description="readings (in the file's unit) that mean no return; ranges become NaN",
    )
    invalid_from: float | None = Field(
        None, description="readings from here on (in the file's unit) mean no return; ranges become NaN"
    )
    row_stamps: RowStamps | None = Field(None, description="for a file without a time column")
    frame: str | None = Field(None, description="frame_id of the messages; absent: by kind")
    child_frame: str | None = Field(None, description="odometry's child frame; absent: base_link")
    delimiter: str = Field(",", min_length=1, max_length=1)


class CsvLayout(StrictModel):
    """A folder of CSV files: its streams, base frame and mountings. Without `streams`: the default file names."""

    version: Literal[1] = 1
    base_frame: str | None = None
    streams: list[CsvStream] = Field(default_factory=list)
    mounting: dict[str, FrameMounting] = Field(default_factory=dict)
