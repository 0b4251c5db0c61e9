"""report.html: the report as a self-contained page."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from gridslam.core.files import write_atomic
from gridslam.core.nested import flatten
from gridslam.report.errors_over_time import errors_of
from gridslam.report.figures.path_plot import path_plot
from gridslam.report.figures.plots import Line, time_plot
from gridslam.report.marks import untrusted_stretches
from gridslam.report.page import page_bytes
from gridslam.runs.run import Run
from gridslam.runs.run_counts import Counts

TEMPLATE = "report.html.j2"
# Notes on series; the series that have one are plotted before the others
NOTES = {
    "inlier_ratio": "fraction of each scan that agrees with the map",
    "confidence": "of the pose, from 0 to 1",
}


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot as SVG, with title and an explanatory note."""

    title: str
    svg: Markup
    note: str = ""


@dataclass(frozen=True, slots=True)
class EmbeddedPicture:
    """A picture as base64 PNG, with title and note."""

    title: str
    png: str
    note: str


def write_html(path: Path, run: Run, document: Mapping[str, Any]) -> None:
    """Write the page; map.png and the method's pictures are read from the same folder."""
    picture = path.with_name("map.png")
    page = page_bytes(
        TEMPLATE,
        run=document,
        map_png=base64.b64encode(picture.read_bytes()).decode() if picture.exists() else "",
        pictures=list(pictures(run, path.parent)),
        plots=list(plots(run)),
        stretches=list(untrusted_stretches(run.result)),
        loops=len(run.result.loops_ns),
        skipped=skipped_lines(run.counts),
        measures=dict(flatten(document["measures"])),
        files=sorted(item.name for item in path.parent.iterdir()),
    )
    write_atomic(path, page)


def pictures(run: Run, folder: Path) -> Iterator[EmbeddedPicture]:
    """The method's own pictures, read from the folder."""
    for name, picture in sorted(run.result.pictures.items()):
        png = base64.b64encode((folder / f"{name}.png").read_bytes()).decode()
        yield EmbeddedPicture(picture.title, png, picture.note)


def skipped_lines(counts: Counts) -> list[str]:
    """Lines on the messages that were not used, with the reasons, the most frequent first."""
    ranked = sorted(counts.skipped_by_reason.items(), key=lambda item: (-item[1], item[0]))
    lines = []
    for key, number in ranked:
        stream, _, reason = key.partition(".")
        read = counts.streams[stream].read if stream in counts.streams else 0
        lines.append(f"{number} of {max(read, number)} {stream} messages: {reason.replace('_', ' ')}")
    return lines + [f"lost: {number} {what.replace('_', ' ')}" for what, number in counts.lost.items()]


def plots(run: Run) -> Iterator[Plot]:
    """The path beside odometry and ground truth, errors over time if there is ground truth, then the method's series."""
    if (paths := path_plot(run)) is not None:
        yield Plot("Odometry and result", Markup(paths), "odometry from the same start")
    start_ns = _start_ns(run)
    if (errors := errors_of(run)) is not None:
        times = _seconds(errors.stamps_ns, start_ns)
        note = "against ground truth" + (", after rigid alignment" if errors.align == "se2" else "")
        yield Plot("Position error", Markup(time_plot([Line(times, errors.ape.translation_m)], "m")), note)
        yield Plot("Heading error", Markup(time_plot([Line(times, errors.ape.rotation_deg)], "deg")), note)
    for name, series in sorted(run.result.series.items(), key=lambda item: (item[0] not in NOTES, item[0])):
        line = Line(_seconds(series.stamps_ns, start_ns), series.values)
        title = name[:1].upper() + name[1:].replace("_", " ")
        yield Plot(title, Markup(time_plot([line], series.unit)), NOTES.get(name, ""))


def _start_ns(run: Run) -> int:
    stamps = [s.stamps_ns for s in run.result.series.values()] + [run.result.trajectory.stamps_ns]
    return min((int(s.min()) for s in stamps if len(s)), default=0)


def _seconds(stamps_ns: NDArray[np.int64], start_ns: int) -> NDArray[np.float64]:
    return np.asarray((stamps_ns - start_ns) / 1e9)
