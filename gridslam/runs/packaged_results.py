"""Checks of results of methods in other packages; for methods of this package the type checker makes them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from numbers import Integral, Real

import numpy as np

from gridslam.core.texts import is_storable
from gridslam.core.trajectory import Trajectory
from gridslam.maps.image_levels import MAX_PIXELS
from gridslam.maps.occupancy import GridGeometry, GridLayer
from gridslam.methods.base import Doubt, PlacedObject, RunResult, Series, Table
from gridslam.runs.packaged_sizes import excesses

_RUN_FILES = (
    "map.png", "map.pgm", "map.yaml", "layers.npz", "trajectory.tum",
    "run.yaml", "report.json", "report.html", "result.mcap",
)  # fmt: skip
_PLAIN = frozenset((str, float, int, bool, type(None)))
_DOUBTS = ("lost", "inconsistent", "apart")


def packaged_problems(result: RunResult) -> Iterator[str]:
    """Faults in the parts of a plug-in's result, in words that follow "the result"; they rely on the checks of all results."""
    yield from excesses(result)
    for trajectory in (result.trajectory, *result.trajectories.values()):
        yield from _disorder(trajectory)
    for grid in (result.occupancy, *result.maps.values()):
        if grid is not None and type(grid.probability) is not np.ndarray:
            yield f"has a map that is not a plain array, but a {type(grid.probability).__name__}"
    yield from _repeated_files(result)
    for name, table in result.tables.items():
        yield from _problems_of_table(name, table)
    yield from _problems_of_objects(result.objects)
    for series in (
        *result.series.values(),
        *([result.position_std] if result.position_std is not None else []),
    ):
        yield from _problems_of_series(series)
    yield from _problems_of_layers(result.layers)
    for picture in result.pictures.values():
        if not 0 < picture.rgb.size <= 3 * MAX_PIXELS or not _are_texts((picture.title, picture.note)):
            yield f"has a picture without pixels, with more than {MAX_PIXELS}, or whose title is not a string"
    yield from _problems_of_facts(result)


def _problems_of_layers(layers: Mapping[str, GridLayer]) -> Iterator[str]:
    for name, layer in layers.items():
        values = layer.values
        if not isinstance(layer.geometry, GridGeometry) or not _are_texts((name,)) or not name.isprintable():
            yield f"has a layer {name!r} without a name in printable characters, or without a geometry"
        elif type(values) is not np.ndarray or values.ndim < 2 or values.dtype.kind not in "biuf":
            yield f"has a layer {name!r} that is not an array of numbers (rows, cols)"
    if sum(np.size(layer.values) for layer in layers.values()) > MAX_PIXELS:
        yield f"has layers of more than {MAX_PIXELS} values in all"


def _disorder(trajectory: Trajectory) -> Iterator[str]:
    stamps = trajectory.stamps_ns
    if not isinstance(stamps, np.ndarray) or not isinstance(trajectory.poses, np.ndarray):
        yield "has a trajectory that is not made of arrays"
    elif (later := np.flatnonzero(stamps[1:] <= stamps[:-1])).size:
        yield (
            f"has stamps that do not ascend: pose {later[0] + 1} is not after the one before "
            "(`Trajectory.sorted()` sorts poses and leaves repeated stamps out)"
        )


def _repeated_files(result: RunResult) -> Iterator[str]:
    """Parts that would be written to the same file, or to a file of the run itself, in words."""
    endings = {
        "maps": (".pgm", ".yaml"),
        "pictures": (".png",),
        "tables": (".csv",),
        "trajectories": (".tum",),
    }
    written = [name + end for kind, ends in endings.items() for name in getattr(result, kind) for end in ends]
    taken = set(_RUN_FILES)
    for file in chain(written, result.files):
        if file in taken:
            yield f"has two parts for the file {file!r}, or one for a file of the run"
        taken.add(file)


def _problems_of_table(name: str, table: Table) -> Iterator[str]:
    if not isinstance(table.columns, Sequence) or not _are_texts(table.columns):
        yield f"has a table {name!r} whose columns are not all texts"
        return
    if not isinstance(table.rows, (Sequence, np.ndarray)):
        yield f"has a table {name!r} whose rows are not a sequence"
        return
    for number, row in enumerate(table.rows):
        is_plain = type(row) in (list, tuple) and len(row) == len(table.columns)
        if is_plain and _PLAIN.issuperset(map(type, row)):
            continue  # as nearly all are; the checks below take longer
        if not isinstance(row, (Sequence, np.ndarray)) or len(row) != len(table.columns):
            yield f"has a table {name!r} whose row {number} has not one value for each of its {len(table.columns)} columns"
        elif not all(cell is None or isinstance(cell, (str, Real, np.generic)) for cell in row):
            yield f"has a table {name!r} whose row {number} has a value that is neither a number nor a string"


def _problems_of_objects(objects: object) -> Iterator[str]:
    if not isinstance(objects, Sequence) or not all(isinstance(found, PlacedObject) for found in objects):
        yield "has objects that are not a sequence of PlacedObject"
        return
    for found in objects:
        if not _are_texts((found.name, found.state)) or not _is_finite(found.pose, (3,)):
            yield f"has an object {found.name!r} without a pose (3,) of finite numbers, or whose name or state is not a string"


def _problems_of_series(series: object) -> Iterator[str]:
    if not isinstance(series, Series) or not _are_texts((series.unit,)):
        yield "has a series that is not a Series, or whose unit is not a string"
    elif not _are_stamps(series.stamps_ns, 1) or np.shape(series.values) != np.shape(series.stamps_ns):
        yield "has a series whose stamps and values are not arrays (n,), the stamps of integers from 0 on"
    elif not isinstance(series.values, np.ndarray) or series.values.dtype.kind not in "biuf":
        yield "has a series whose values are not numbers"


def _problems_of_facts(result: RunResult) -> Iterator[str]:
    for kind, number in (("counters", Integral), ("timings_s", Real)):
        facts = getattr(result, kind)
        if not isinstance(facts, Mapping) or not _are_texts(facts):
            yield f"has {kind} that are not a mapping of names"
        elif not all(isinstance(value, number) for value in facts.values()):
            yield f"has {kind} that are not numbers"
    if not isinstance(result.measures, Mapping):
        yield "has measures that are not a mapping"
    if (
        isinstance(result.notes, str)
        or not isinstance(result.notes, Sequence)
        or not _are_texts(result.notes)
    ):
        yield "has notes that are not a sequence of strings"
    for kind in ("loops_ns", "untrusted_ns"):
        if not _are_stamps(getattr(result, kind), 2) or getattr(result, kind).shape[1] != 2:
            yield f"has {kind} that are not integers (k, 2) from 0 on"
    doubt = result.doubt
    if doubt is not None and (
        not isinstance(doubt, Doubt) or doubt.status not in _DOUBTS or not _are_texts((doubt.reason,))
    ):
        yield f"has a doubt that is not a Doubt with a reason and one of {', '.join(_DOUBTS)}"


def _are_texts(values: Iterable[object]) -> bool:
    return all(isinstance(value, str) and is_storable(value) for value in values)


def _are_stamps(values: object, dimensions: int) -> bool:
    return (
        isinstance(values, np.ndarray)
        and values.ndim == dimensions
        and values.dtype.kind in "iu"
        and bool((values >= 0).all())
    )


def _is_finite(values: object, shape: tuple[int, ...]) -> bool:
    array = np.asarray(values)
    return array.shape == shape and array.dtype.kind in "iuf" and bool(np.isfinite(array).all())
