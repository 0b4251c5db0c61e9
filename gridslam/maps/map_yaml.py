"""Reader of the YAML file of a map_server map; every key is checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from gridslam.config.errors import short
from gridslam.config.yaml_file import read_yaml
from gridslam.core.errors import ConfigError, MapError
from gridslam.core.texts import parse_number

Mode = Literal["trinary", "scale", "raw"]

MODES: dict[str, Mode] = {"trinary": "trinary", "scale": "scale", "raw": "raw"}
MAX_ORIGIN = 1e9  # m, m, rad; with larger coordinates float64 arithmetic is not accurate to a centimetre


@dataclass(frozen=True, slots=True)
class MapYaml:
    """The values of the YAML file; the origin is the pose of the lower-left corner of the lower-left cell."""

    image: str
    mode: Mode
    resolution_m: float
    origin_xy_m: tuple[float, float]
    origin_yaw_rad: float
    negate: bool
    occupied_thresh: float
    free_thresh: float


def read_map_yaml(path: Path) -> MapYaml:
    """Read and check a map's YAML file.

    Raises MapError: a key is missing or a value invalid; the message names the file and the key.
    """
    document = _read_mapping(path)
    image = _get(path, document, "image")
    if not isinstance(image, str) or not image or "\0" in image:
        raise MapError(f"{path}: image: expected the name of an image file, got {short(image)}")
    mode = document.get("mode", "trinary")
    if not isinstance(mode, str) or mode.lower() not in MODES:
        raise MapError(f"{path}: mode: expected trinary, scale or raw, got {short(mode)}")
    resolution = _number(path, "resolution", _get(path, document, "resolution"))
    if not 1e-4 <= resolution <= 1e3:
        raise MapError(
            f"{path}: resolution: expected metres a cell between 0.0001 and 1000, got {resolution:g}"
        )
    origin = _get(path, document, "origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapError(f"{path}: origin: expected [x, y, yaw], got {short(origin)}")
    x, y, yaw = (_number(path, f"origin[{i}]", value) for i, value in enumerate(origin))
    if max(abs(x), abs(y), abs(yaw)) > MAX_ORIGIN:
        raise MapError(
            f"{path}: origin: expected metres and radians up to {MAX_ORIGIN:g}, got {short(origin)}"
        )
    occupied = _threshold(path, document, "occupied_thresh")
    free = _threshold(path, document, "free_thresh")
    if not free < occupied:
        raise MapError(f"{path}: free_thresh {free:g} is not below occupied_thresh {occupied:g}")
    return MapYaml(
        image=image,
        mode=MODES[mode.lower()],
        resolution_m=resolution,
        origin_xy_m=(x, y),
        origin_yaw_rad=yaw,
        negate=_negate(path, document),
        occupied_thresh=occupied,
        free_thresh=free,
    )


def _read_mapping(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise MapError(f"{path}: no such map; give the YAML file of a map_server map")
    try:
        return read_yaml(path)
    except ConfigError as error:
        raise MapError(f"{error}; expected a map's YAML file") from None


def _get(path: Path, document: dict[str, Any], key: str) -> Any:
    if key not in document:
        raise MapError(f"{path}: the key {key!r} is missing")
    return document[key]


def _number(path: Path, key: str, value: Any) -> float:
    """A finite number; text such as 1e-3, which YAML 1.1 does not read as a number, is accepted."""
    if not isinstance(value, bool) and isinstance(value, (int, float, str)):
        try:
            finite = parse_number(value) if isinstance(value, str) else float(value)
        except (ValueError, OverflowError):
            finite = math.nan
        if math.isfinite(finite):
            return finite
    raise MapError(f"{path}: {key}: expected a finite number, got {short(value)}")


def _threshold(path: Path, document: dict[str, Any], key: str) -> float:
    """An occupancy from 0 to 1. Percent and grey values would load as a map without obstacles."""
    value = _number(path, key, _get(path, document, key))
    if 0.0 <= value <= 1.0:
        return value
    message = f"{path}: {key}: expected a number from 0 to 1, got {value:g}"
    if 1.0 < value <= 100.0:
        message += f"; if it is in percent, write {value / 100.0:.4g}"
    elif 100.0 < value <= 255.0:
        message += f"; if it is a grey value of 255, write {value / 255.0:.4g}"
    raise MapError(message)


def _negate(path: Path, document: dict[str, Any]) -> bool:
    value = _get(path, document, "negate")
    if isinstance(value, (bool, int)):
        return bool(value)
    raise MapError(f"{path}: negate: expected 0 or 1, got {short(value)}")
