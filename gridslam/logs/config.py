"""The `log` section of a configuration: which streams, in which order, and how sensors are mounted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pydantic import Field, field_validator, model_validator

from gridslam.config.base import StrictModel
from gridslam.core.stamps import END_S
from gridslam.logs.csv_layout import CsvLayout
from gridslam.logs.kinds import EVENT_KINDS, OLDER_NAMES

if TYPE_CHECKING:
    StreamKind: TypeAlias = str
else:
    StreamKind = Literal[EVENT_KINDS]

MAX_HEIGHT_M = 1000.0  # largest height above or below the base; higher numbers are mistaken units


class ExtrinsicsConfig(StrictModel):
    """T_base_sensor: the pose of a sensor on the robot (rotated by roll, then pitch, then yaw about fixed axes)."""

    x: float = Field(
        0.0,
        description="Position forward of the base, in metres.",
    )
    y: float = Field(
        0.0,
        description="Position left of the base, in metres.",
    )
    yaw: float = Field(
        0.0,
        description="Rotation about z, counter-clockwise, in rad.",
    )
    z: float = Field(
        0.0,
        description="Height above the base, in metres.",
    )
    roll: float = Field(
        0.0,
        description="Rotation about x, in rad.",
    )
    pitch: float = Field(
        0.0,
        description="Rotation about y, in rad; positive tilts the sensor's view downwards.",
    )


class CarmenConfig(StrictModel):
    """Field of view and maximum range of CARMEN's FLASER lines, which do not state them."""

    field_of_view_deg: float | None = Field(
        None,
        gt=0.0,
        le=360.0,
        description="Angle from the first to the last beam, in degrees. Absent: derived from the number of beams.",
    )
    range_max_m: float | None = Field(
        None,
        gt=0.0,
        description="Range in metres from which on readings mean no return. Absent: found in the log.",
    )


class CloudConfig(StrictModel):
    """The band of heights in which a point cloud becomes a scan."""

    min_height_m: float | None = Field(
        None,
        ge=-MAX_HEIGHT_M,
        le=MAX_HEIGHT_M,
        description="Lower end of the band: z in the base frame, in metres. Absent: 0.2 where the sensor stands at "
        "least 0.3 m above the base, else 0.3 m below the sensor. Raise it if ground returns appear as "
        "walls.",
    )
    max_height_m: float | None = Field(
        None,
        ge=-MAX_HEIGHT_M,
        le=MAX_HEIGHT_M,
        description="Upper end of the band: z in the base frame, in metres. Absent: 1.8, or 0.3 m above the sensor. "
        "Lower it if ceilings or lintels appear as walls.",
    )

    @model_validator(mode="after")
    def _is_a_band(self) -> CloudConfig:
        low, high = self.min_height_m, self.max_height_m
        if low is not None and high is not None and low >= high:
            raise ValueError(f"min_height_m {low:g} is not below max_height_m {high:g}")
        return self


class WheelsConfig(StrictModel):
    """Names of the wheel joints in JointState messages."""

    left: str | None = Field(
        None, description="Name of the left wheel's joint. Absent: the one with `wheel` and `left` in it."
    )
    right: str | None = Field(
        None, description="Name of the right wheel's joint. Absent: the one with `wheel` and `right` in it."
    )


class LogLimits(StrictModel):
    """Guards against damaged and hostile files."""

    chunk_mb: int = Field(
        512,
        gt=0,
        description="Largest record or unpacked chunk of a log, in MiB. Raise it if larger ones are left "
        "out; it needs more memory.",
    )
    line_mb: int = Field(
        16,
        gt=0,
        description="Longest line of a text log, in MiB. Raise it if longer lines are left out; it needs more memory.",
    )
    reorder_mb: int = Field(
        512,
        gt=0,
        description="Largest memory of the messages that wait for earlier ones, in MiB. Raise it if messages come out "
        "of order.",
    )


class LogConfig(StrictModel):
    """Settings for reading a log. All are optional: without `topics`, streams are found by their type."""

    topics: dict[StreamKind, str | list[str]] = Field(
        default_factory=dict,
        description="Topic of each kind of stream; needed where a log has two of one kind. [] leaves the kind out.",
    )
    truth: str | None = Field(
        None,
        description="Topic of the true pose; no method reads it. Absent: /ground_truth where the log has it.",
    )
    order: Literal["recorded", "stamp"] | None = Field(
        None,
        description="Order of the messages of a stream: as recorded, or sorted by stamp. Absent: as recorded.",
    )
    start_s: float | None = Field(
        None,
        ge=0.0,
        le=END_S,
        description="Seconds after the log's start from which it is used. Absent: from the start.",
    )
    end_s: float | None = Field(
        None,
        ge=0.0,
        le=END_S,
        description="Seconds after the log's start up to which it is used. Absent: to the end.",
    )
    base_frame: str | None = Field(
        None,
        description="Frame of the robot's base. Absent: the odometry's child frame, else base_link.",
    )
    extrinsics: dict[str, ExtrinsicsConfig] = Field(
        default_factory=dict,
        description="Poses of sensors on the robot by sensor frame; they take precedence over tf_static.",
    )
    cloud: CloudConfig = CloudConfig()
    sweep_s: float | None = Field(
        None,
        gt=0.0,
        description="Time in seconds from the first to the last beam of a scan, for drivers that leave time_increment at 0; "
        "motion within a scan is then undone. Absent: found by the robot's turns where these show it, else the beams count "
        "as taken at once.",
    )
    wheels: WheelsConfig = WheelsConfig()
    carmen: CarmenConfig = CarmenConfig()
    csv: CsvLayout | Path | None = Field(
        None,
        description="Layout of a CSV folder, given here or as the path of a log.yaml.",
    )
    limits: LogLimits = LogLimits()

    @model_validator(mode="after")
    def _span_in_order(self) -> LogConfig:
        if self.start_s is not None and self.end_s is not None and self.start_s > self.end_s:
            raise ValueError(f"start_s {self.start_s:g} is not before end_s {self.end_s:g}")
        return self

    @field_validator("topics", mode="before")
    @classmethod
    def _older_kinds(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        return {
            OLDER_NAMES.get(key, key) if isinstance(key, str) else key: topic for key, topic in value.items()
        }
