"""gridslam drawing show"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import console
from ..options import AsJson, check_output_file, common

app = typer.Typer(invoke_without_command=True, rich_markup_mode=None)


class WallTone(str, Enum):
    """The colour of the walls."""

    auto = "auto"
    dark = "dark"
    bright = "bright"


PictureArgument = Annotated[
    Path, typer.Argument(metavar="PICTURE", readable=False, help="A drawing, as for map --drawing.")
]
PictureOutput = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="PNG", help="Write a picture of what was understood."),
]
Replace = Annotated[bool, typer.Option("--force", help="Replace an existing picture.")]
WallsAre = Annotated[WallTone, typer.Option("--walls-are", help="As method.drawing.walls_are.")]
MaxGap = Annotated[
    float, typer.Option("--max-gap", metavar="UNITS", min=0.0, max=10.0, help="As method.drawing.max_gap.")
]


@app.callback()
def group(context: typer.Context) -> None:
    """Show how a drawing is read."""
    if context.invoked_subcommand is None:
        console.emit(context.get_help())
        raise typer.Exit(2)


def show(
    picture: PictureArgument,
    output: PictureOutput = None,
    force: Replace = False,
    walls_are: WallsAre = WallTone.auto,
    max_gap: MaxGap = 0.3,
    as_json: AsJson = False,
) -> None:
    """Show what handmap-slam understands of a drawing: its walls, free space, and what is ignored.

    The picture of -o has the drawing frame along its edges, in drawing units: read a start for method.start from it.
    """
    from gridslam.maps.drawings.drawing import drawn_map, load_drawing
    from gridslam.report.drawing_reading import reading_document, write_reading

    from ..interruption import finishing

    if output is not None:
        check_output_file(output, force, [picture])
    drawing = load_drawing(picture)
    drawn = drawn_map(drawing, walls_are.value, max_gap)
    document = reading_document(picture, drawing, drawn)
    with finishing():
        if output is not None:
            write_reading(output, drawing, drawn)
        if as_json:
            console.emit_json(document)
        else:
            console.emit("\n".join(_lines(document)))


def _lines(document: dict[str, Any]) -> list[str]:
    width, height = document["size"]
    ignored = document["ignored"]
    source = "a photograph" if document["is_photograph"] else "a painted picture"
    return [
        f"size         {width:g} x {height:g} drawing units, {source}",
        f"walls        {document['walls_are']}",
        f"light        {'uneven, evened' if document['light_evened'] else 'even'}",
        f"perspective  {'undone: the drawing is the sheet of paper' if document['perspective_undone'] else 'none found'}",
        f"gaps closed  {document['gaps_closed']}",
        f"ignored      letters or words {ignored['texts']}, arrows {ignored['arrows']}, specks {ignored['specks']}",
        f"outer wall   {'open: nothing encloses a place' if document['is_open'] else 'closed'}",
        f"free space   {100.0 * document['free_ratio']:.1f} % of the drawing",
    ]


app.command("show")(common(show))
