"""gridslam evaluate"""

from __future__ import annotations

import math
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import console
from ..options import AsJson

if TYPE_CHECKING:
    from gridslam.evaluation.document import EvaluationOptions


TRUTH_FOLDER = "truth"  # written by `gridslam explore` into its run directory
MAX_DELTA = 1e9  # frames, metres or seconds


class AlignName(str, Enum):
    """How the estimate is aligned with the ground truth."""

    none = "none"
    se2 = "se2"
    origin = "origin"


class SyncName(str, Enum):
    """How poses are paired."""

    nearest = "nearest"
    interpolate = "interpolate"


class DeltaUnitName(str, Enum):
    """Unit of the distance between the two poses of a relative error."""

    frames = "frames"
    metres = "metres"
    seconds = "seconds"


ResultPath = Annotated[
    Path, typer.Argument(metavar="DIR|TUM", readable=False, help="A run directory, or a trajectory.")
]
TruthPath = Annotated[
    Path | None,
    typer.Option(
        "--truth",
        metavar="PATH",
        readable=False,
        help="True poses: a trajectory (t x y z qx qy qz qw, or t x y yaw), a log that contains them, or a folder "
        "NAME.truth, whose map and objects are used too. Default: the folder DIR/truth of an exploration.",
    ),
]
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
SyncOption = Annotated[SyncName, typer.Option("--sync", help="Use the nearest pose in time, or interpolate.")]
MaxDifference = Annotated[
    float,
    typer.Option("--max-difference", metavar="S", min=0.0, help="Largest time difference of paired poses."),
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
    path: ResultPath,
    truth: TruthPath = None,
    truth_map: TruthMap = None,
    relations: RelationsPath = None,
    truth_objects: TruthObjects = None,
    align: AlignOption = None,
    scale: Scale = False,
    sync: SyncOption = SyncName.nearest,
    max_difference: MaxDifference = 0.01,
    delta: DeltaSize = 1.0,
    delta_unit: DeltaUnitOption = DeltaUnitName.frames,
    all_pairs: AllPairs = False,
    completeness_radius: CompletenessRadius = None,
    max_position: MaxPosition = 0.5,
    max_heading: MaxHeading = 10.0,
    require: Require = None,
    as_json: AsJson = False,
) -> None:
    """Compare a result with ground truth, and check the errors against bounds."""
    from gridslam.core.errors import ConfigError, GateError
    from gridslam.evaluation import document as measures
    from gridslam.evaluation.from_files import load_result, load_truth
    from gridslam.evaluation.gates import check_keys, failures, parse_gate

    gates = [parse_gate(text) for text in require or ()]
    if truth is None and (path / TRUTH_FOLDER).is_dir():
        truth = path / TRUTH_FOLDER
    if not any((truth, truth_map, relations, truth_objects)):
        raise ConfigError(
            "nothing to compare with: give --truth, --relations, --truth-map or --truth-objects"
        )
    options = _options(
        path,
        align,
        scale,
        sync,
        max_difference,
        delta,
        delta_unit,
        all_pairs,
        completeness_radius,
        max_position,
        max_heading,
    )
    true = load_truth(truth, truth_map, relations, truth_objects)
    result = load_result(path, true)
    document = measures.evaluate(result, true, options)
    if not document:
        raise ConfigError(f"{path}: has nothing to compare with this ground truth")
    check_keys(gates, document, measures.NEEDS)
    if as_json:
        console.emit_json(measures.without_nan(document))
    else:
        _show(document)
    failed = failures(gates, document)
    for line in failed[:-1]:
        console.complain(f"error: {line}")
    if failed:
        raise GateError(failed[-1])


def _options(
    path: Path,
    align: AlignName | None,
    scale: bool,
    sync: SyncName,
    max_difference_s: float,
    delta: float,
    unit: DeltaUnitName,
    all_pairs: bool,
    completeness_radius_m: float | None,
    max_position_m: float,
    max_heading_deg: float,
) -> EvaluationOptions:
    from gridslam.core.errors import ConfigError
    from gridslam.core.stamps import END_S
    from gridslam.evaluation.document import EvaluationOptions
    from gridslam.evaluation.pose_errors import Delta
    from gridslam.evaluation.run_files import run_command_of

    if align is None:
        align = AlignName.se2 if run_command_of(path) in ("map", "explore") else AlignName.none
    if scale and align is not AlignName.se2:
        raise ConfigError("--scale: only --align se2 estimates a scale")
    whole = unit is not DeltaUnitName.frames or delta.is_integer()
    if not (0.0 < delta <= MAX_DELTA and whole):
        raise ConfigError(
            f"--delta {delta:g}: expected a positive number up to {MAX_DELTA:g}, a whole number of frames"
        )
    if not max_difference_s <= END_S:
        raise ConfigError(f"--max-difference {max_difference_s:g}: expected seconds up to {END_S:g}")
    return EvaluationOptions(
        align=align.value,
        with_scale=scale,
        sync=sync.value,
        max_difference_ns=round(max_difference_s * 1e9),
        delta=Delta(delta, unit.value, all_pairs),
        completeness_radius_m=completeness_radius_m,
        max_position_m=max_position_m,
        max_heading_deg=max_heading_deg,
    )


_UNITS = {
    "ape.trans": "m", "ape.rot": "deg", "rpe.trans": "m", "rpe.rot": "deg", "relations.trans": "m",
    "relations.rot": "deg", "map.accuracy": "m", "map.completeness": "m", "objects.position": "m",
    "objects.heading": "deg", "final.trans": "m", "final.rot": "deg", "localization.time_to_convergence": "s",
}  # fmt: skip


def _show(document: dict[str, Any]) -> None:
    """Print the measures as a table, a row per dotted key."""
    from gridslam.evaluation.gates import measures_of

    rows = [(key, _text(value), _unit(key)) for key, value in measures_of(document).items()]
    console.emit_table(("measure", "value", "unit"), rows)


def _unit(key: str) -> str:
    unit = _UNITS.get(key) or _UNITS.get(key.rpartition(".")[0], "")
    if key.endswith(".var"):
        return "m^2"
    return "" if key.endswith(".count") else unit


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.6g}"
    return str(value)
