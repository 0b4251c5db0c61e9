"""gridslam correlation"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from .. import console
from ..options import AsJson, check_output_file

MapArgument = Annotated[
    Path, typer.Argument(metavar="MAP", readable=False, help="A map: a map_server YAML, or wean.dat(.gz).")
]
PictureOutput = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="PNG", help="Draw the measured curves and the fit.")
]
FitSeed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the random start cells and directions.")]
Samples = Annotated[int, typer.Option("--samples", min=1, max=5_000_000, help="Number of random walks.")]
OccupiedFrom = Annotated[
    float,
    typer.Option("--occupied-from", metavar="P", min=0.0, max=1.0, help="Cells above this are occupied."),
]
Replace = Annotated[bool, typer.Option("--force", help="Replace an existing picture.")]


def run(
    map_path: MapArgument,
    output: PictureOutput = None,
    seed: FitSeed = 0,
    samples: Samples = 100_000,
    occupied_from: OccupiedFrom = 0.5,
    force: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Fit the correlation of neighbouring cells, r0 of stereo-bayes, to a known map."""
    from gridslam.core.files import write_atomic
    from gridslam.maps.load import load_any_map, map_files
    from gridslam.maps.occupancy_correlation import fit_correlation

    from ..interruption import finishing

    if output is not None:
        check_output_file(output, force, map_files(map_path))
    fit = fit_correlation(load_any_map(map_path), seed, samples, occupied_from)
    document = {
        "map": str(map_path),
        "r0": fit.r0,
        "standard_error": fit.standard_error if math.isfinite(fit.standard_error) else None,
        "r0_at_5cm": fit.r0_at_5cm,
        "continuation": fit.continuation,
        "occupied_ratio": fit.occupied_ratio,
        "resolution_m": fit.resolution_m,
        "samples": fit.samples,
        "censored": fit.censored,
        "seed": seed,
    }
    with finishing():
        if output is not None:
            from gridslam.report.figures.run_length_plot import correlation_picture

            write_atomic(output, correlation_picture(fit, map_path.name))
        if as_json:
            console.emit_json(document)
        else:
            console.emit_table(("measure", "value"), [(key, _text(value)) for key, value in document.items()])


def _text(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
