"""gridslam evaluate"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from ..options import AsJson, TruthTopic


class AlignName(str, Enum):
    """Alignments of the estimate with the ground truth, as options of the command."""

    none = "none"
    se2 = "se2"
    origin = "origin"


class SyncName(str, Enum):
    """Pairings of estimated with true poses, as options of the command."""

    nearest = "nearest"
    interpolate = "interpolate"


class DeltaUnitName(str, Enum):
    """Unit of the distance between the two poses of a relative error."""

    frames = "frames"
    metres = "metres"
    seconds = "seconds"


ResultPaths = Annotated[
    list[Path],
    typer.Argument(
        metavar="RESULT...",
        readable=False,
        help="Run directories or trajectories (TUM, t x y yaw, KITTI, EuRoC, CSV), or logs with --topic.",
    ),
]
TruthPath = Annotated[
    Path | None,
    typer.Option(
        "--truth",
        metavar="PATH",
        readable=False,
        help="True poses: a trajectory (as RESULT), a log that contains them, or a folder "
        "NAME.truth, whose map and objects are used too. Default: the folder DIR/truth of an exploration.",
    ),
]
ResultTopic = Annotated[
    str | None, typer.Option("--topic", metavar="TOPIC", help="Topic of the poses if RESULT is a log.")
]
TimeOffset = Annotated[
    float, typer.Option("--time-offset", metavar="S", help="Seconds added to the stamps of the results.")
]
OutputFolder = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Write plots (PNG, SVG), an HTML page and JSON."),
]
ReplaceOutput = Annotated[bool, typer.Option("--force", help="Replace an existing evaluation in DIR.")]
AllMeasures = Annotated[bool, typer.Option("--all", help="Print all measures instead of the main ones.")]
TruthMap = Annotated[
    Path | None,
    typer.Option("--truth-map", metavar="MAP.yaml", readable=False, help="The true map: a map_server YAML."),
]
TruthObjects = Annotated[
    Path | None,
    typer.Option(
        "--truth-objects", metavar="CSV", readable=False, help="The true objects: id,class,x,y,yaw,..."
    ),
]
RelationsPath = Annotated[
    Path | None,
    typer.Option(
        "--relations",
        metavar="FILE",
        readable=False,
        help="True relative motions, one per line: t1 t2 x y z roll pitch yaw.",
    ),
]
AlignOption = Annotated[
    AlignName | None,
    typer.Option(
        "--align",
        help="Alignment of the estimate. Default: se2 for run directories of map and explore, otherwise none.",
    ),
]
Scale = Annotated[bool, typer.Option("--scale", help="Let --align se2 estimate a scale too.")]
SyncOption = Annotated[
    SyncName,
    typer.Option(
        "--sync", help="Pair with the nearest pose in time, or interpolate between the two neighbours."
    ),
]
MaxDifference = Annotated[
    float | None,
    typer.Option(
        "--max-difference",
        metavar="S",
        min=0.0,
        help="Largest time difference of paired poses. Default: 0.01 for --sync nearest.",
    ),
]
MaxGap = Annotated[
    float | None,
    typer.Option(
        "--max-gap",
        metavar="S",
        min=0.0,
        help="Largest time between the two poses that --sync interpolate takes. Default: 1.",
    ),
]
DeltaSize = Annotated[
    float, typer.Option("--delta", metavar="N", help="Distance between the two poses of an RPE pair.")
]
DeltaUnitOption = Annotated[DeltaUnitName, typer.Option("--delta-unit", help="Unit of --delta.")]
AllPairs = Annotated[
    bool, typer.Option("--all-pairs", help="RPE over all pairs instead of consecutive ones.")
]
CompletenessRadius = Annotated[
    float | None,
    typer.Option(
        "--reach",
        metavar="M",
        min=0.0,
        help="Completeness: only true walls within M of the known cells of the map.",
    ),
]
MaxPosition = Annotated[
    float,
    typer.Option(
        "--max-position",
        metavar="M",
        min=0.0,
        help="Largest position error of a successful localization or a correct object.",
    ),
]
MaxHeading = Annotated[
    float,
    typer.Option(
        "--max-heading", metavar="DEG", min=0.0, help="Largest heading error of a successful localization."
    ),
]
Require = Annotated[
    list[str] | None,
    typer.Option("--require", metavar="KEY<=NUMBER", help="Gate: exit with 1 unless it holds. Repeatable."),
]


def run(
    paths: ResultPaths,
    truth: TruthPath = None,
    truth_topic: TruthTopic = None,
    truth_map: TruthMap = None,
    relations: RelationsPath = None,
    truth_objects: TruthObjects = None,
    topic: ResultTopic = None,
    output: OutputFolder = None,
    align: AlignOption = None,
    scale: Scale = False,
    sync: SyncOption = SyncName.nearest,
    max_difference: MaxDifference = None,
    max_gap: MaxGap = None,
    time_offset: TimeOffset = 0.0,
    delta: DeltaSize = 1.0,
    delta_unit: DeltaUnitOption = DeltaUnitName.frames,
    all_pairs: AllPairs = False,
    completeness_radius: CompletenessRadius = None,
    max_position: MaxPosition = 0.5,
    max_heading: MaxHeading = 10.0,
    require: Require = None,
    all_measures: AllMeasures = False,
    force: ReplaceOutput = False,
    as_json: AsJson = False,
) -> None:
    """Compare results with ground truth, and check the errors against bounds."""
    from ..evaluating import MeasureOptions, Request, TruthOptions, run_evaluation

    run_evaluation(
        Request(
            paths=tuple(paths),
            topic=topic,
            truth=TruthOptions(truth, truth_topic, truth_map, relations, truth_objects),
            measures=MeasureOptions(
                align=align.value if align else None,
                scale=scale,
                sync=sync.value,
                max_difference_s=max_difference,
                max_gap_s=max_gap,
                time_offset_s=time_offset,
                delta=delta,
                delta_unit=delta_unit.value,
                all_pairs=all_pairs,
                completeness_radius_m=completeness_radius,
                max_position_m=max_position,
                max_heading_deg=max_heading,
            ),
            require=tuple(require or ()),
            output=output,
            force=force,
            all_measures=all_measures,
            as_json=as_json,
        )
    )
