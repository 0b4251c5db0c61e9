"""Writes a run to its directory."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Iterable
from pathlib import Path

from PIL import Image

from gridslam.core.files import ANY, Identity, write_atomic
from gridslam.maps.map_server import save_map
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.packaged import naming
from gridslam.methods.registry import package_of
from gridslam.report.directory import REPORT_NAME, new_run_directory
from gridslam.report.document import json_bytes, plain, report_document
from gridslam.report.html import write_html
from gridslam.report.layers import write_layers
from gridslam.report.marks import marks_of
from gridslam.report.run_yaml import FILE_NAME as RUN_YAML
from gridslam.report.run_yaml import write_run_yaml
from gridslam.report.text_files import write_table, write_tum
from gridslam.report.viewer_log import write_viewer_log
from gridslam.runs.run import Run


def write_run(
    run: Run,
    directory: Path,
    force: bool = False,
    further: Iterable[Path] = (),
    before: Identity | None = ANY,
) -> dict[str, object]:
    """Write all files of a run; the directory appears when they are complete. Returns the document of report.json.

    `further`: files and folders that are moved into the directory (log and ground truth of an exploration).
    `before`: the identity that `check_free` returned before the run.

    Raises ConfigError if the directory exists or cannot be written; and MethodError, which names the package of the method, if a
    part of its result cannot be written.
    """
    with naming(package_of(run.config.method_name), passed=(OSError,)):
        return _write_run(run, directory, force, further, before)


def _write_run(
    run: Run, directory: Path, force: bool, further: Iterable[Path], before: Identity | None
) -> dict[str, object]:
    started = time.perf_counter()
    further = tuple(further)
    log_path = next((path for path in further if path.name == run.log_path.name), run.log_path)
    with new_run_directory(directory, force, before) as folder:
        write_map_files(run, folder)
        write_tum(folder / "trajectory.tum", run.result.trajectory)
        for name, trajectory in sorted(run.result.trajectories.items()):
            write_tum(folder / f"{name}.tum", trajectory)
        for name, content in sorted(run.result.files.items()):
            write_atomic(folder / name, content)
        for name, table in sorted(run.result.tables.items()):
            write_table(folder / f"{name}.csv", table)
        write_run_yaml(folder / RUN_YAML, run)
        if run.config.output.viewer:
            write_viewer_log(folder / "result.mcap", run, log_path)
        if run.config.output.html:
            write_html(folder / "report.html", run, report_document(run, time.perf_counter() - started))
        document: dict[str, object] = plain(report_document(run, time.perf_counter() - started))
        write_atomic(folder / REPORT_NAME, json_bytes(document))
        for path in further:
            shutil.move(path, folder / path.name)
    return document


def write_map_files(run: Run, folder: Path) -> None:
    """Write map.pgm, map.yaml and layers.npz if the run built a map, and map.png of this or a given map.

    Further maps and pictures of the method are written under their own names.
    """
    result = run.result
    layers = dict(result.layers)
    if run.occupancy is not None and run.occupancy.probability.size:
        write_atomic(folder / "map.png", png_bytes(_map_picture(run, run.occupancy)))
    if result.occupancy is not None and result.occupancy.probability.size:
        save_map(result.occupancy, folder / "map")
        layers.setdefault("probability", GridLayer(result.occupancy.probability, result.occupancy.geometry))
    for name, occupancy in sorted(result.maps.items()):
        save_map(occupancy, folder / name)
    for name, made in sorted(result.pictures.items()):
        write_atomic(folder / f"{name}.png", png_bytes(Image.fromarray(made.rgb)))
    if run.config.output.layers and layers:
        write_layers(folder / "layers.npz", layers)


def _map_picture(run: Run, grid: OccupancyGrid) -> Image.Image:
    marks = marks_of(run.result)
    return render_map(grid, run.result.trajectory, marks=marks, with_grid=run.config.output.grid)


def png_bytes(picture: Image.Image) -> bytes:
    """The picture as the bytes of a PNG file."""
    file = io.BytesIO()
    picture.save(file, format="PNG")
    return file.getvalue()
