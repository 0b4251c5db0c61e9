"""ir-scan: the map of a room, and six laps (section 2.5), with the before/after picture of figures 10 and 11."""

from __future__ import annotations

import numpy as np

from tests.papers.page import Experiment, Picture, Section
from tests.papers.work import Found, Work, both, picture_of, seeds_text

CPU_MINUTES = 7.0
TEXT = """A small robot stops every 40 cm, sweeps three infrared rangers on servos, and maps a room of 4 x 3 m with
seven boxes. The experiments are `configs/sweeps/ir-scan.yaml`, `ir-laps.yaml` and `ir-navigation.yaml`. The
robot's start is known and nothing else is aligned."""
MAPPING = """Error of the mapped walls: distance of every mapped wall cell (1 cm) to the nearest true wall; the
paper's five runs, the mean over ours, the largest of all runs. `Laid over` puts the path on the true one first, as
somebody does who lays a map over a plan."""
LAPS = """Error of the last position of six laps of four way points (47 m, 117 stops, 3 cm cells). The paper drives
by a map made before: `on the true map`; the rows above it map while they drive."""
FALLS_SHORT = "The paper's form misses the paper's {what} with nothing aligned."
LONE = """ That is a cell or two in a single run, where wild readings beside each other agree; the paper's filter keeps
them, the best settings do not."""

LITTLE = """With our gyro the paper's matching changes little while mapping ({matched:.2g} cm, {gyro:.2g} cm
without): it shifts by whole cells of 3 cm, more than there is to correct."""


def section(work: Work) -> Section:
    """Room and laps."""
    experiments = [room(work), laps(work)]
    return Section("ir-scan", "ir-scan: infrared rangers on servos", TEXT, experiments)


def room(work: Work) -> Experiment:
    """Mean, variance and maximum, as the paper's table has them."""
    known = work.sweep("ir-scan")
    laid = work.sweep("ir-scan", {"evaluate": {"align": "se2"}, "require": ()}, "ir-scan-laid-over")
    seeds = seeds_text(known.seeds)
    rows: list[tuple[object, ...]] = []
    for suffix, found in (("", known), (", laid over", laid)):

        def figure(key: str, scale: float, of_all: str, config: str, found: Found = found) -> str:
            values = scale * found.values(f"map.accuracy.{key}", "ir-room", config)
            return f"{values.max() if of_all == 'max' else values.mean():.3g}"

        for name, published, key, scale, of_all in (
            ("mean, cm", 3.376, "mean", 1e2, "mean"),
            ("variance, cm2", 19.636, "var", 1e4, "mean"),
            ("largest, cm", 19.4, "max", 1e2, "max"),
        ):
            ours = both(lambda c, k=key, s=scale, o=of_all, f=figure: f(k, s, o, c))
            rows.append((name + suffix, None if suffix else published, *ours, seeds))
    pictures = [
        Picture(
            f"ir-{config}",
            picture_of(
                known.directory("ir-room", config, "default", known.seeds[0]) / "raw_and_filtered.png"
            ),
            f"Raw readings by odometry, and the map ({name}), seed {known.seeds[0]}, as figures 10 and 11",
        )
        for config, name in (("paper", "the paper's form"), ("best", "best settings"))
    ]
    return Experiment("The map of a room (figures 10 and 11)", MAPPING, rows, pictures, missed(known))


def missed(found: Found) -> str:
    """Which of the paper's three figures its form misses here."""
    values = {key: found.values(f"map.accuracy.{key}", "ir-room", "paper") for key in ("mean", "var", "max")}
    checks = {
        "mean": 1e2 * values["mean"].mean() > 3.376,
        "variance": 1e4 * values["var"].mean() > 19.636,
        "largest error": 1e2 * values["max"].max() > 19.4,
    }
    names = [name for name, is_missed in checks.items() if is_missed]
    text = FALLS_SHORT.format(what=" and ".join(names)) if names else ""
    return text + LONE if names == ["largest error"] and np.sum(1e2 * values["max"] > 19.4) == 1 else text


def laps(work: Work) -> Experiment:
    """Final position errors."""
    mapping, given = work.sweep("ir-laps"), work.sweep("ir-navigation")
    seeds = seeds_text(mapping.seeds)
    rows: list[tuple[object, ...]] = []
    for name, published, found, override in (
        ("encoders alone", "50.5 cm (internal sensors)", mapping, "encoders"),
        ("encoders and gyro", None, mapping, "gyro"),
        ("with matching, mapping", None, mapping, "matching"),
        ("with matching, on the true map", "2.5 cm", given, "start"),
    ):

        def error(config: str, found: Found = found, override: str = override) -> str:
            values = 100 * found.values("final.trans", "ir-laps", config, override)
            return f"{values.mean():.1f} cm (worst {values.max():.1f})"

        rows.append((name, published, *both(error), seeds))
    gyro = mapping.mean("final.trans", "ir-laps", "paper", "gyro")
    matched = mapping.mean("final.trans", "ir-laps", "paper", "matching")
    short = ""
    if matched > 0.8 * gyro:
        short = LITTLE.format(matched=100 * matched, gyro=100 * gyro)
    return Experiment("Six laps", LAPS, rows, short=short)
