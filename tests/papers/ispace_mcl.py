"""ispace-mcl: global localization in a monotonous corridor with people, with and without environment cameras (section 4.5)."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from gridslam.sweep.config import load_sweep
from gridslam.sweep.summary import wilson_interval
from tests.benchmarks.ispace_figure import draw_curves
from tests.benchmarks.ispace_worlds import log_of
from tests.papers.page import Experiment, PagePicture, Section
from tests.papers.work import Found, Work, both, seeds_text

CPU_MINUTES = 21.0
WORLDS = range(5)
SEEDS = "0..9"
ALONE = "onboard"
FUSED = "cameras"
CURVES = {
    "onboard alone, the paper's filter": ("paper", ALONE),
    "with cameras, the paper's equations": ("paper", FUSED),
    "with cameras, best settings": ("best", FUSED),
}
SHOWN_S = 50.0
TEXT = """A robot with odometry and a lidar of 5.6 m is somewhere in a corridor of 30 m that repeats itself every 5
m, among two to four people who walk; eight fixed RGB-D cameras see every place from both sides, two frames a
second. Success: within 0.5 m and 10 degrees, held to the end. Five worlds (0 to 4: start, route, people, noise),
each with filter seeds {seeds}; the sweep is written to `out/papers/ispace-mcl/sweep.yaml`."""
FALLS_SHORT = """The rate without cameras depends on how alike the bays of the corridor are and how far the lidar
sees; ours ({rate:.0f} %) is another corridor than the paper's. The paper's equations need every place in view: in
corridors with gaps between the cameras' views the product of densities loses the robot, the best settings do not
([ispace-mcl](ispace-mcl.md))."""

Floats = NDArray[np.float64]


def section(work: Work) -> Section:
    """Success rates and standard deviations."""
    found = sweep_of(work)
    text = TEXT.format(seeds=seeds_text(found.seeds))
    return Section(
        "ispace-mcl",
        "ispace-mcl: localization with environment cameras",
        text,
        [successes(found), deviations(found)],
    )


def sweep_of(work: Work) -> Found:
    """The runs, as a sweep over the rendered logs."""
    document = {
        "command": "localize",
        "logs": [{"log": str(log_of("covered", number)), "map": "{truth}/map.yaml"} for number in WORLDS],
        "configs": {"paper": "paper/ispace-mcl", "best": "ispace-mcl"},
        "overrides": {ALONE: ["method.cameras.enabled=false"], FUSED: []},
        "seeds": SEEDS,
        "evaluate": {"sync": "interpolate"},
    }
    work.folder.mkdir(parents=True, exist_ok=True)
    file = work.folder / "sweep.yaml"
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return work.run(load_sweep(file), work.folder, {}, "sweep")


def successes(found: Found) -> Experiment:
    """Success rates with Wilson's intervals, and times to convergence."""
    seeds = f"{seeds_text(found.seeds)}, 5 worlds"
    rows = []
    for title, published, override in (
        ("found without cameras", "about 40 %", ALONE),
        ("found with cameras", "over 90 %", FUSED),
    ):
        hits = {c: pooled(found, "localization.success", c, override) for c in ("paper", "best")}
        rows.append((title, published, *both(lambda c, hits=hits: rate(hits[c])), seeds))
    for title, override in (("time to convergence without cameras", ALONE), ("with cameras", FUSED)):
        rows.append((title, None, *both(lambda c, override=override: seconds(found, c, override)), seeds))
    alone = pooled(found, "localization.success", "paper", ALONE).mean()
    short = FALLS_SHORT.format(rate=100 * alone)
    what = "How often the robot is found from anywhere; times are medians of the successes, Wilson's 95 % interval in brackets."
    return Experiment("Success of global localization", what, rows, short=short)


def deviations(found: Found) -> Experiment:
    """Figure 10."""
    curves = {name: curves_of(found, *place) for name, place in CURVES.items()}
    rows = []
    for second in (5.0, 20.0):
        for title, override in (("without cameras", ALONE), ("with cameras", FUSED)):
            cells = [f"{std_at(found, second, c, override):.2f} m" for c in ("paper", "best")]
            published = "falls faster" if override == FUSED else None
            rows.append((f"after {second:.0f} s, {title}", published, *cells, seeds_text(found.seeds)))
    file = found.folder / "std.png"
    draw_curves(curves, file, SHOWN_S)
    picture = PagePicture(
        "ispace-std",
        rgb_of(file),
        "Standard deviation of all particles: median and middle half of the trials",
    )
    what = "The standard deviation of the particles' positions over time (figure 10); medians over all runs."
    return Experiment("Convergence of the particles", what, rows, [picture])


def std_at(found: Found, second: float, config: str, override: str) -> float:
    """Median over the runs of the standard deviation (m) at a time after the start."""
    return float(np.median([np.interp(second, *curve) for curve in curves_of(found, config, override)]))


def pooled(found: Found, key: str, config: str, override: str) -> Floats:
    """A measure over all worlds and seeds."""
    logs = dict.fromkeys(row.log for row in found.result.rows)
    return np.concatenate([found.values(key, log, config, override) for log in logs])


def rate(successes: Floats) -> str:
    """46 of 50 (81 to 97 %)."""
    hits, n = int(successes.sum()), len(successes)
    low, high = wilson_interval(hits, n)
    return f"{hits} of {n} ({100 * low:.0f} to {100 * high:.0f} %)"


def seconds(found: Found, config: str, override: str) -> str:
    """Median time to convergence of the successful runs, as text."""
    success = pooled(found, "localization.success", config, override) > 0
    times = pooled(found, "localization.time_to_convergence", config, override)[success]
    return f"{np.median(times):.1f} s" if len(times) else "-"


def curves_of(found: Found, config: str, override: str) -> Sequence[tuple[Floats, Floats]]:
    """Time (s) and standard deviation (m) of every run."""
    rows = [row for row in found.result.rows if (row.config, row.override) == (config, override)]
    return [curve(found.directory(row.log, config, override, row.seed) / "localization.csv") for row in rows]


def curve(path: Path) -> tuple[Floats, Floats]:
    """Standard deviation (m) over the time (s) since the first scan."""
    with path.open() as stream:
        table: list[Mapping[str, str]] = list(csv.DictReader(stream))
    stamps = np.array([float(row["stamp"]) for row in table])
    return stamps - stamps[0], np.array([float(row["std_all"]) for row in table])


def rgb_of(path: Path) -> NDArray[np.uint8]:
    """A picture as RGB."""
    return np.asarray(cv2.imread(str(path))[..., ::-1], np.uint8)
