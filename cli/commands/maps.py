"""gridslam maps crop|rotate|merge|compare|export"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from gridslam.core.errors import ConfigError

from .. import console
from ..options import AsJson, check_output_file, common

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gridslam.maps.occupancy import OccupancyGrid

app = typer.Typer(invoke_without_command=True, rich_markup_mode=None)

MapArgument = Annotated[
    Path, typer.Argument(metavar="MAP", readable=False, help="A map_server YAML, or wean.dat(.gz).")
]
SecondMap = Annotated[
    Path, typer.Argument(metavar="OTHER", readable=False, help="Another map of the same place.")
]
NewMap = Annotated[Path, typer.Option("--output", "-o", metavar="YAML", help="The map to write.")]
Pose = Annotated[
    str | None,
    typer.Option(
        "--pose", metavar="X,Y,YAW", help="Pose of OTHER in MAP (m, m, rad). Default: by registration."
    ),
]
MAX_COMPARED_CELLS = (
    25_000_000  # largest map that is compared cell by cell, which takes a second or two per million
)
Force = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]
Mode = Annotated[
    Literal["trinary", "scale", "raw"],
    typer.Option("--mode", help="How map_server writes the probabilities."),
]


@app.callback()
def group(context: typer.Context) -> None:
    """Crop, rotate, merge, compare and export maps."""
    if context.invoked_subcommand is None:
        console.emit(context.get_help())
        raise typer.Exit(2)


Polygon = Annotated[
    str | None,
    typer.Option("--polygon", metavar="'X,Y X,Y ...'", help="Keep what lies inside these corners (m)."),
]
Reachable = Annotated[
    str | None,
    typer.Option("--reachable", metavar="X,Y", help="Keep what can be reached from this free point (m)."),
]


def crop(
    map_path: MapArgument,
    output: NewMap,
    polygon: Polygon = None,
    reachable: Reachable = None,
    mode: Mode = "trinary",
    force: Force = False,
) -> None:
    """Keep a part of a map: inside a polygon, or what can be reached from a point."""
    from gridslam.maps.editing import crop_to_polygon, crop_to_reachable
    from gridslam.maps.load import load_any_map

    if (polygon is None) == (reachable is None):
        raise ConfigError("maps crop: give either --polygon or --reachable")
    grid = load_any_map(map_path)
    if polygon is not None:
        corners = _numbers(polygon.split(), 2, "--polygon")
        if len(corners) < 3:
            raise ConfigError("--polygon: expected at least three corners, for example '0,0 5,0 5,4'")
        grid = crop_to_polygon(grid, corners)
    else:
        grid = crop_to_reachable(grid, _numbers([str(reachable)], 2, "--reachable")[0])
    _save(grid, output, [map_path], mode=mode, force=force)


Yaw = Annotated[
    float | None,
    typer.Option("--yaw", metavar="DEG", help="Rotate by this angle. Default: walls lie along the axes."),
]


def rotate(
    map_path: MapArgument, output: NewMap, yaw: Yaw = None, mode: Mode = "trinary", force: Force = False
) -> None:
    """Rotate a map about the origin of its frame, by default so that its walls lie along the axes."""
    import numpy as np

    from gridslam.maps.editing import MAX_CELLS, moved, wall_direction
    from gridslam.maps.load import load_any_map

    grid = load_any_map(map_path, MAX_CELLS)  # a turned map is not smaller
    rotation = np.radians(yaw) if yaw is not None else -wall_direction(grid)
    if not np.isfinite(rotation):
        raise ConfigError("--yaw: expected a number of degrees")
    _save(
        moved(grid, np.array([0.0, 0.0, float(rotation)])),
        output,
        [map_path],
        mode=mode,
        force=force,
        rows=[("turned", f"{round(float(np.degrees(rotation)), 3) + 0.0:.3f} deg")],
    )


def merge(
    map_path: MapArgument,
    other: SecondMap,
    output: NewMap,
    pose: Pose = None,
    mode: Mode = "trinary",
    force: Force = False,
) -> None:
    """Lay two overlapping maps on each other; the result has the frame and the resolution of the first."""
    from gridslam.maps.editing import MAX_CELLS, merged
    from gridslam.maps.load import load_any_map

    base, second = (load_any_map(path, MAX_CELLS) for path in (map_path, other))
    T_base_other, rows = _overlap(base, second, pose)
    _save(merged(base, second, T_base_other), output, [map_path, other], mode=mode, force=force, rows=rows)


Picture = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="PNG", help="A picture of both maps.")
]


def compare(
    map_path: MapArgument,
    other: SecondMap,
    picture: Picture = None,
    pose: Pose = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Compare two maps of one place, aligned by their walls: distances between walls, overlap, a picture."""
    import numpy as np

    from gridslam.core.files import write_atomic
    from gridslam.evaluation.map_comparison import compare_maps
    from gridslam.maps.load import load_any_map, map_files

    from ..interruption import finishing

    if picture is not None:
        check_output_file(picture, force, [*map_files(map_path), *map_files(other)])
    base, second = (load_any_map(path, MAX_COMPARED_CELLS) for path in (map_path, other))
    T_base_other = _alignment(base, second, pose)
    found = compare_maps(base, second, T_base_other)
    figures = {
        "map.accuracy.mean": float(np.mean(found.accuracy_m)) if len(found.accuracy_m) else None,
        "map.completeness.mean": float(np.mean(found.completeness_m)) if len(found.completeness_m) else None,
        "map.iou": found.iou if np.isfinite(found.iou) else None,
        "pose": [round(float(v), 5) for v in T_base_other],
    }
    encoded = io.BytesIO()
    found.picture.save(encoded, format="PNG")
    with finishing():
        if picture is not None:
            write_atomic(picture, encoded.getvalue())
        if as_json:
            console.emit_json(figures)
        else:
            console.emit_table(("measure", "value"), [(name, str(value)) for name, value in figures.items()])


ExportPath = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="FILE.yaml, .png, .svg, .dxf or .tif.")
]
Epsg = Annotated[int | None, typer.Option("--epsg", help="Projected coordinate system of a GeoTIFF.")]
GeoOrigin = Annotated[
    str | None,
    typer.Option(
        "--geo-origin", metavar="EAST,NORTH", help="The map frame's origin in that system (m); x points east."
    ),
]


def export(
    map_path: MapArgument,
    output: ExportPath,
    mode: Mode = "trinary",
    epsg: Epsg = None,
    geo_origin: GeoOrigin = None,
    force: Force = False,
) -> None:
    """Write a map for other programs: map_server YAML (.yaml with PGM, .png), outlines (.svg, .dxf), GeoTIFF (.tif)."""
    from gridslam.core.files import write_atomic
    from gridslam.maps import drawings_out
    from gridslam.maps.load import load_any_map, map_files

    from ..interruption import finishing

    kind = output.suffix.lower()
    if kind not in (".yaml", ".png", ".svg", ".dxf", ".tif", ".tiff"):
        raise ConfigError(f"{output}: expected a name that ends in .yaml, .png, .svg, .dxf or .tif")
    if kind in (".tif", ".tiff") and (epsg is None or geo_origin is None):
        raise ConfigError(f"{output}: a GeoTIFF needs --epsg and --geo-origin EAST,NORTH")
    grid = load_any_map(map_path)
    if kind in (".yaml", ".png"):
        _save(grid, output, [map_path], mode=mode, force=force)
        return
    check_output_file(output, force, map_files(map_path))
    if kind == ".svg":
        content = drawings_out.svg_text(grid).encode()
    elif kind == ".dxf":
        content = drawings_out.dxf_text(grid).encode()
    else:
        east, north = _numbers([str(geo_origin)], 2, "--geo-origin")[0].tolist()
        content = drawings_out.geotiff_bytes(grid, int(epsg or 0), (east, north))
    with finishing():
        write_atomic(output, content)
        console.emit_table(("", ""), [("written", str(output))])


app.command("crop")(common(crop))
app.command("rotate")(common(rotate))
app.command("merge")(common(merge))
app.command("compare")(common(compare))
app.command("export")(common(export))


def _alignment(base: OccupancyGrid, other: OccupancyGrid, pose: str | None) -> NDArray[np.float64]:
    """`T_base_other` (3,) of maps of one place, as given or by their walls."""
    from gridslam.evaluation.map_comparison import align_maps

    found = align_maps(other, base).T_truth_map if pose is None else _numbers([pose], 3, "--pose")[0]
    T_base_other: NDArray[np.float64] = found
    return T_base_other


def _overlap(
    base: OccupancyGrid, other: OccupancyGrid, pose: str | None
) -> tuple[NDArray[np.float64], list[tuple[str, str]]]:
    """`T_base_other` (3,) of maps that overlap in part, as given or by walls and free space, and rows that say so."""
    if pose is not None:
        return _numbers([pose], 3, "--pose")[0], [("pose", pose)]
    from gridslam.evaluation.map_comparison import overlap_of

    found = overlap_of(other, base)
    x, y, yaw = found.T_base_other.tolist()
    return found.T_base_other, [
        ("pose", f"{x:.3f},{y:.3f},{yaw:.5f}"),
        ("walls in free space of the other map", f"{100 * found.contradicted_ratio:.1f} %"),
    ]


def _numbers(words: list[str], count: int, option: str) -> NDArray[np.float64]:
    """Rows of `count` numbers between commas. Raises ConfigError: a word is not of that form."""
    import numpy as np

    from ..coordinates import coordinates

    form = f"{count} numbers between commas"
    return np.array([coordinates(option, word, (count,), form) for word in words], np.float64)


def _save(
    grid: OccupancyGrid,
    output: Path,
    inputs: Sequence[Path],
    *,
    mode: Literal["trinary", "scale", "raw"],
    force: bool,
    rows: Sequence[tuple[str, str]] = (),
) -> None:
    """Write a map_server YAML with its image, and print its size; with `force` also in place of one of the `inputs`.

    An input is never replaced in part: its image alone.
    """
    from gridslam.core.files import check_file_free, real_path, refuse_to_replace
    from gridslam.maps.load import map_files
    from gridslam.maps.map_server import save_map

    from ..interruption import finishing

    stem = output.name.removesuffix(output.suffix)
    if output.suffix not in ("", ".yaml", ".pgm", ".png") or stem in ("", ".", ".."):
        raise ConfigError(f"{output}: expected a name that ends in .yaml")
    base = output.with_suffix("")
    kind: Literal["png", "pgm"] = "png" if output.suffix == ".png" or mode == "scale" else "pgm"
    yaml_path, image_path = (base.with_name(f"{base.name}.{suffix}") for suffix in ("yaml", kind))
    others = [path for path in inputs if real_path(path) != real_path(yaml_path)]
    for path in (yaml_path, image_path):
        check_file_free(path, force)
        refuse_to_replace(path, [file for other in others for file in map_files(other)])
    n_rows, n_cols = grid.probability.shape
    x, y = grid.geometry.origin_xy_m
    size = f"{n_cols} x {n_rows} cells of {100 * grid.geometry.resolution_m:g} cm, origin {x:.3f}, {y:.3f}"
    with finishing():
        written = save_map(grid, base, mode, image_format=kind)
        console.emit_table(("", ""), [*rows, ("map", size), ("written", str(written))])
