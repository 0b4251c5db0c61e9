"""What `log.yaml` says about a folder of CSV files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pydantic import Field, field_validator, model_validator

from gridslam.config.base import StrictModel
from gridslam.core.stamps import END_S, NS_PER_S
from gridslam.logs.kinds import CSV_KINDS, OLDER_NAMES

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


_LENGTHS = frozenset({"m", "cm", "mm"})
_ANGLES = frozenset({"rad", "deg", "rad_clockwise", "deg_clockwise"})
_TIMES = frozenset({"s", "ms", "us", "ns"})
UNITS_OF: dict[str, frozenset[str]] = {
    **dict.fromkeys(("stamp", "time_increment"), _TIMES),
    **dict.fromkeys(("x", "y", "z", "r", "range", "range_min", "range_max", "baseline"), _LENGTHS),
    **dict.fromkeys(("yaw", "bearing", "angle_min", "angle_increment", "left", "right"), _ANGLES),
    "vx": _LENGTHS | {"m/s"},  # a length or an angle stands for one per second
    "wz": _ANGLES | {"rad/s", "deg/s"},
}
"""The units that a column may have; columns that are missing here have none."""


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
    """One CSV file as one stream. The columns' own names are in the table of message kinds."""

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

    version: Literal[1] = 1
    base_frame: str | None = None
    streams: list[CsvStream] = Field(default_factory=list)
    extrinsics: dict[str, FrameExtrinsics] = Field(default_factory=dict)

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
