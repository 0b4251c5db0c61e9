"""The runs whose results must stay: every method on its sample log, an exploration, a plan, a sweep, the sample logs."""

from __future__ import annotations

import sys
from pathlib import Path

SAMPLES = "sample_logs"
DRAWING = "configs/worlds/drawings/corridor.png"
GIVEN = {
    "slam-sd": ("map", f"{SAMPLES}/slam-sd.mcap"),
    "slam-sd-tags": ("map", f"{SAMPLES}/slam-sd-tags.mcap", "--tags", f"{SAMPLES}/slam-sd-tags.truth/tags.yaml"),
    "handmap-slam": ("map", f"{SAMPLES}/handmap-slam.mcap", "--drawing", DRAWING),
    "ir-scan": ("map", f"{SAMPLES}/ir-scan.mcap"),
    "ispace-mcl": ("localize", f"{SAMPLES}/ispace-mcl.mcap", "--map", f"{SAMPLES}/ispace-mcl.truth/map.yaml"),
    "stereo-bayes": ("map", f"{SAMPLES}/stereo-bayes.mcap"),
}  # fmt: skip
SWEEP = """\
command: map
logs: [{{log: {samples}/ir-scan.mcap}}]
configs: {{paper: paper/ir-scan, best: ir-scan}}
overrides: {{coarse: [method.resolution_m=0.03]}}
seeds: 0..1
evaluate: {{align: origin}}
"""


def commands(folder: Path, threads: int) -> dict[str, list[str]]:
    """The command of every run by its name; each writes into the folder of its name below `folder`."""
    gridslam, jobs = [str(Path(sys.executable).with_name("gridslam"))], ["--jobs", str(threads)]
    found = {}
    for name, given in GIVEN.items():
        method = name.removesuffix("-tags")
        for form, config in (("best", method), ("paper", f"paper/{method}")):
            found[f"{name}.{form}"] = [*gridslam, *given, "-c", config, "--set", "output.viewer=true", *jobs]
    found["explore"] = [*gridslam, "explore", "hand-corridor-20", "--drawing", DRAWING, "-c", "handmap-slam",
                        "--start-in-drawing", "2.7,3.2,0", *jobs]  # fmt: skip
    found["plan"] = [
        *gridslam,
        "plan",
        f"{SAMPLES}/slam-sd.truth/map.yaml",
        "--start",
        "4.5,21,1.57",
        "--goal",
        "10,3,0",
    ]
    found["sweep"] = [*gridslam, "sweep", str(folder / "sweep.yaml"), *jobs]
    for name, command in found.items():
        command += ["--quiet", "-o", str(folder / name)]
    found["samples"] = [sys.executable, "-m", "gridslam.simulation.samples", str(folder / "samples")]
    return found


def write_sweep(folder: Path) -> None:
    """The file of the run `sweep`."""
    (folder / "sweep.yaml").write_text(SWEEP.format(samples=Path(SAMPLES).resolve()))
