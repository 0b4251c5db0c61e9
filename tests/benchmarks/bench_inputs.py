"""slam-sd on one drive as each kind of robot records it, without any config: the error against that of the ordinary recording."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from gridslam import api
from gridslam.evaluation.inputs import EvaluationOptions
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.input_kinds import KINDS, MORE_KINDS, ORDINARY, drive

SEED = 11
OPTIONS = EvaluationOptions(align="se2", sync="interpolate")
FLOOR_M = 0.005  # errors below it count as it: the truth of a map of 5 cm cells


def rows() -> Iterator[BenchmarkRow]:
    """Each kind's APE by that of the ordinary recording.

    INPUTS_SEEDS=1,2 measures other drives, with INPUTS_ELSEWHERE=1 through an office floor of the seed each;
    INPUTS_KINDS=cloud,livox these kinds, which may be of `MORE_KINDS`.
    """
    seeds = [int(s) for s in os.environ.get("INPUTS_SEEDS", str(SEED)).split(",")]
    kinds = [k for k in os.environ.get("INPUTS_KINDS", "").split(",") if k] or list(KINDS)
    is_elsewhere = os.environ.get("INPUTS_ELSEWHERE", "") == "1"
    known = KINDS | MORE_KINDS
    worst: dict[str, float] = {}
    for seed in seeds:
        errors: dict[str, float] = {}
        made = drive(seed, is_elsewhere)
        makers = ORDINARY | {kind: known[kind][0] for kind in kinds}
        with tempfile.TemporaryDirectory() as scratch:
            truth = Path(scratch) / "truth.tum"
            truth.write_text(made.truth)
            for kind, maker in makers.items():
                started = time.process_time()
                log = maker(made, Path(scratch) / f"{kind}.mcap")
                run = api.map_log(log, "slam-sd")
                errors[kind] = api.evaluate(run, truth, options=OPTIONS)["ape"]["trans"]["rmse"]
                say(
                    f"inputs, seed {seed}, {kind}: {errors[kind]:.4f} m, {time.process_time() - started:.1f} CPU s; "
                    f"{'; '.join(run.report['log']['problems'])[:300]}"
                )
                log.unlink()
        for kind in kinds:
            ratio = max(errors[kind], FLOOR_M) / max(errors[known[kind][1]], FLOOR_M)
            worst[kind] = max(worst.get(kind, 0.0), ratio)
        for kind in ORDINARY:
            worst[f"{kind}.ape"] = max(worst.get(f"{kind}.ape", 0.0), errors[kind])
    for name, value in worst.items():
        yield BenchmarkRow(f"inputs.{name}", value, "m" if name.endswith(".ape") else "of the ordinary error")
