"""Reader of objects.csv: one row per object, or per object and time."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

from gridslam.core.errors import InputError
from gridslam.core.plain_files import open_plain_file
from gridslam.core.texts import parse_number
from gridslam.evaluation.object_errors import MapObject

_BOOLEANS = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}


def read_objects(path: Path) -> dict[str, MapObject]:
    """Objects by id, from the columns `id,x,y,yaw` and, if present, `class,moved,state`.

    If an id has several rows (poses over time), the last one counts. Raises InputError with the line.
    """
    try:
        with io.TextIOWrapper(open_plain_file(path), "utf-8-sig", newline="") as stream:
            rows = csv.DictReader(stream)
            missing = {"id", "x", "y", "yaw"} - set(rows.fieldnames or ())
            if missing:
                raise InputError(f"{path}:1: the columns {', '.join(sorted(missing))} are missing")
            return {row["id"]: _object(f"{path}:{rows.line_num}", row) for row in rows}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a CSV file ({error})") from None


def _object(place: str, row: dict[str, str | None]) -> MapObject:
    if not row["id"]:
        raise InputError(f"{place}: the id is empty")
    x, y, yaw = (_number(place, key, row[key]) for key in ("x", "y", "yaw"))
    return MapObject(
        (x, y, yaw), row.get("class") or None, _boolean(place, row.get("moved")), row.get("state") or None
    )


def _number(place: str, key: str, text: str | None) -> float:
    try:
        value = parse_number(text or "nan")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{place}: {key}: expected a finite number, got {text!r}")
    return value


def _boolean(place: str, text: str | None) -> bool | None:
    if not text:
        return None
    value = _BOOLEANS.get(text.strip().lower())
    if value is None:
        raise InputError(f"{place}: moved: expected true or false, got {text!r}")
    return value
