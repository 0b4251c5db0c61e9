"""Models of `log.yaml`, which describes a folder of CSV files: its tables, columns, units and extrinsics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pydantic import Field, field_validator, model_validator

from gridslam.config.base import StrictModel
from gridslam.core.stamps import END_S, NS_PER_S
from gridslam.logs.kinds import CSV_KINDS, OLDER_NAMES, UNITS_OF

if TYPE_CHECKING:
    CsvKind: TypeAlias = str
else:
    CsvKind = Literal[tuple(CSV_KINDS)]
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


MAX_TABLES = 500  # largest number in a folder: all are open at the same time, and many systems allow a program 1024 open files


class FrameExtrinsics(StrictModel):
    """Pose of a frame: x, y, z (m) and either roll, pitch, yaw (rad) or a quaternion w, x, y, z."""

    x: float = Field(0.0, description="Position along the parent's x axis, in metres.")
    y: float = Field(0.0, description="Position along the parent's y axis, in metres.")
    z: float = Field(0.0, description="Position along the parent's z axis, in metres.")
    roll: float = Field(0.0, description="Rotation about x, in rad.")
    pitch: float = Field(0.0, description="Rotation about y, in rad.")
    yaw: float = Field(0.0, description="Rotation about z, in rad.")
    quat_wxyz: tuple[float, float, float, float] | None = Field(
        None, description="Rotation as a quaternion w, x, y, z, instead of roll, pitch and yaw."
    )
    parent: str | None = Field(None, description="Name of the parent frame. Absent: the base frame.")


class RowStamps(StrictModel):
    """Stamps of a table without a time column: `start_s + row * period_s`."""

    start_s: float = Field(0.0, ge=0.0, lt=END_S, description="Stamp of the first row in seconds.")
    period_s: float = Field(ge=1.0 / NS_PER_S, lt=END_S, description="Time between two rows in seconds.")


class CsvStream(StrictModel):
    """One CSV file as one stream. The columns' own names are in the table of message kinds."""

    kind: CsvKind = Field(description="Kind of the messages.")
    file: str = Field(min_length=1, description="Path of the file inside the folder.")
    topic: str | None = Field(None, description="Name of the stream for log.topics. Absent: the file's name.")
    columns: dict[str, str] = Field(
        default_factory=dict, description="Name of a column in the file, by its name in the table of kinds."
    )
    units: dict[str, Unit] = Field(
        default_factory=dict, description="Unit of a column in the file, by its name in the table of kinds."
    )
    constants: dict[str, float | str] = Field(
        default_factory=dict,
        description="One value for every row, in the file's unit, for a column that the file does not have.",
    )
    invalid: list[float] = Field(
        default_factory=list, description="Range readings, in the file's unit, that mean no return."
    )
    invalid_from: float | None = Field(
        None, description="Range reading, in the file's unit, from which on readings mean no return."
    )
    row_stamps: RowStamps | None = Field(None, description="Stamps of a file without a time column.")
    frame: str | None = Field(None, description="Frame of the messages. Absent: that of the kind.")
    child_frame: str | None = Field(None, description="Child frame of odometry. Absent: base_link.")
    delimiter: str = Field(",", min_length=1, max_length=1, description="Character between two columns.")

    @field_validator("kind", mode="before")
    @classmethod
    def _older_kind(cls, value: Any) -> Any:
        return OLDER_NAMES.get(value, value) if isinstance(value, str) else value

    @field_validator("columns", "units", "constants")
    @classmethod
    def _known_columns(cls, value: dict[str, object]) -> dict[str, object]:
        known = {"stamp", *(name for kind in CSV_KINDS.values() for name in (*kind.required, *kind.optional))}
        unknown = sorted(set(value) - known - {"r"})
        if unknown:
            raise ValueError(
                f"no column {unknown[0]!r}; columns are {', '.join(sorted(known))}, and r for ranges"
            )
        return value

    @field_validator("units")
    @classmethod
    def _allowed_units(cls, value: dict[str, Unit]) -> dict[str, Unit]:
        for name, unit in value.items():
            allowed = UNITS_OF.get(name, frozenset())
            if unit not in allowed:
                raise ValueError(f"{name} in {unit}: expected {', '.join(sorted(allowed)) or 'no unit'}")
        return value


class CsvLayout(StrictModel):
    """A folder of CSV files. Without `streams`: the files with the default names."""

    version: Literal[1] = Field(1, description="Version of this format.")
    base_frame: str | None = Field(
        None, description="Frame of the robot's base. Absent: the odometry's child frame, else base_link."
    )
    streams: list[CsvStream] = Field(
        default_factory=list, max_length=MAX_TABLES, description="The files with their kinds."
    )
    extrinsics: dict[str, FrameExtrinsics] = Field(
        default_factory=dict, description="Poses of frames on the robot by frame."
    )

    @model_validator(mode="before")
    @classmethod
    def _older_keys(cls, value: Any) -> Any:
        """Older logs say `mounting` for `extrinsics`."""
        if isinstance(value, dict) and "mounting" in value and "extrinsics" not in value:
            return {("extrinsics" if key == "mounting" else key): entry for key, entry in value.items()}
        return value


def default_files() -> dict[str, str]:
    """The kind of each file that a folder without log.yaml may have; names of older logs come last."""
    names = {f"{kind}.csv": kind for kind in CSV_KINDS}
    return names | {f"{older}.csv": kind for older, kind in OLDER_NAMES.items()}
