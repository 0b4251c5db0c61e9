"""The output folder of an evaluation: plots as PNG and SVG, one HTML page with everything, and the document as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from gridslam.core.errors import ConfigError
from gridslam.core.files import (
    check_name,
    making,
    partial_folder,
    put_folder,
    real_path,
    refuse_to_replace,
    write_atomic,
)
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.gates import measures_of
from gridslam.evaluation.headline import text_of, unit_of
from gridslam.report.document import json_bytes
from gridslam.report.figures.drawn_shapes import DrawnSheet, png_of, svg_of
from gridslam.report.figures.evaluation_plots import (
    EvaluatedTrajectory,
    error_drawing,
    overlay_drawing,
    path_error_drawing,
    relative_drawing,
)
from gridslam.report.page import page_bytes

TEMPLATE = "evaluation.html.j2"
DOCUMENT_NAME, PAGE_NAME = "evaluation.json", "evaluation.html"


def check_evaluation_free(directory: Path, force: bool, inputs: Iterable[Path] = ()) -> None:
    """Raise ConfigError unless an evaluation may be written here: a new path, an empty folder, or with `force` an evaluation.

    An evaluation that contains one of the `inputs` is never replaced.
    """
    check_name(directory)
    if not directory.exists() or (directory.is_dir() and not any(directory.iterdir())):
        return
    if not (directory / DOCUMENT_NAME).is_file() or not (directory / PAGE_NAME).is_file():
        raise ConfigError(f"{directory}: exists and is not an evaluation; choose another output folder")
    if not force:
        raise ConfigError(
            f"{directory}: exists; choose another output folder, or --force to replace the evaluation in it"
        )
    refuse_to_replace(directory, inputs)


def write_evaluation(
    directory: Path,
    documents: Mapping[str, dict[str, Any]],
    trajectories: Sequence[EvaluatedTrajectory],
    truth: Trajectory | None,
    output: Mapping[str, Any],
    answers: Sequence[str] = (),
    force: bool = False,
) -> None:
    """Write an evaluation; the folder appears when it is complete. An existing evaluation is only replaced with `force`.

    directory: The folder.
    documents: The measures (with `remarks`) of each result by name.
    trajectories: The results that were compared with the true trajectory `truth`.
    output: The content of evaluation.json.
    answers: The lines about gates.
    """
    check_evaluation_free(directory, force)
    target = real_path(directory)
    with making(directory):
        target.parent.mkdir(parents=True, exist_ok=True)
    with partial_folder(target) as folder:
        plots = []
        for stem, drawing in _drawings(trajectories, truth):
            svg = svg_of(drawing)
            write_atomic(folder / f"{stem}.png", png_of(drawing))
            write_atomic(folder / f"{stem}.svg", svg.encode(errors="replace"))
            plots.append(Markup(svg))
        write_atomic(folder / DOCUMENT_NAME, json_bytes(output))
        page = page_bytes(
            TEMPLATE,
            names=list(documents),
            rows=_rows(documents),
            remarks={name: document.get("remarks", []) for name, document in documents.items()},
            answers=answers,
            plots=plots,
        )
        write_atomic(folder / PAGE_NAME, page)
        put_folder(folder, target)


def _drawings(
    trajectories: Sequence[EvaluatedTrajectory], truth: Trajectory | None
) -> Iterator[tuple[str, DrawnSheet]]:
    if not trajectories or truth is None:
        return
    yield "trajectories", overlay_drawing(trajectories, truth.sorted().poses)
    yield "errors", error_drawing(trajectories)
    for number, trajectory in enumerate(trajectories, start=1):
        suffix = f"_{number}" if len(trajectories) > 1 else ""
        yield f"path_errors{suffix}", path_error_drawing(trajectory)
    relative = relative_drawing(trajectories)
    if relative is not None:
        yield "relative_errors", relative


def _rows(documents: Mapping[str, dict[str, Any]]) -> list[tuple[str, str, list[str]]]:
    """Dotted key, unit and the values of all results, for each measure that any of them has."""
    flat = [measures_of(document) for document in documents.values()]
    keys = list(dict.fromkeys(key for measures in flat for key in measures))
    return [(key, unit_of(key), [text_of(measures.get(key)) for measures in flat]) for key in keys]
