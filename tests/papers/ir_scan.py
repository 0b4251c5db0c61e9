"""ir-scan: the map of a room, and six laps (section 2.5), with the before/after picture of figures 10 and 11."""

from __future__ import annotations

from tests.papers.page import Experiment, PagePicture, Section
from tests.papers.work import Found, Work, both, picture_of, seeds_text

CPU_MINUTES = 7.0
PUBLISHED_RUNS, PUBLISHED_LARGEST_CM = 5, 19.4
TEXT = """A small robot stops every 40 cm, sweeps three infrared rangers on servos, and maps a room of 4 x 3 m with
seven boxes. The experiments are `configs/sweeps/ir-scan.yaml`, `ir-laps.yaml` and `ir-navigation.yaml`. The
robot's start is known; there is no other alignment."""
MAPPING = """Error of the mapped walls: distance of every mapped wall cell (1 cm) to the nearest true wall. The paper made
five runs; means are over all of ours, the largest error is that of the first five and of all. `Aligned` fits
the path to the true one first, as one lays a map over a plan."""
LAPS = """Error of the last position of six laps of four waypoints (47 m, 117 stops, 3 cm cells). The paper drives
with a given map: `on the true map`; the rows above map while they drive."""
FALLS_SHORT = "The paper's form misses the paper's {what} without alignment."
LONE = """With the paper's form {runs} of {all} runs {have} one or two cells up to {largest:.0f} cm off, where neighbouring
wild readings agree: the paper's filter keeps them, the best settings do not."""

LITTLE = """With our gyro the paper's matching changes little while mapping ({matched:.2g} cm, {gyro:.2g} cm
without): it shifts by whole cells of 3 cm, which is more than the error."""


def section(work: Work) -> Section:
    """Room and laps."""
    experiments = [room(work), laps(work)]
    return Section("ir-scan", "ir-scan: infrared rangers on servos", TEXT, experiments)


def room(work: Work) -> Experiment:
    """Mean, variance and maximum, as in the paper's table."""
    known = work.sweep("ir-scan")
    aligned = work.sweep("ir-scan", {"evaluate": {"align": "se2"}, "require": ()}, "ir-scan-aligned")
    seeds = seeds_text(known.seeds)
    rows: list[tuple[object, ...]] = []
    for suffix, found in (("", known), (", aligned", aligned)):

        def figure(key: str, scale: float, config: str, found: Found = found) -> str:
            return f"{scale * found.mean(f'map.accuracy.{key}', 'ir-room', config):.3g}"

        def largest(runs: int, config: str, found: Found = found) -> str:
            return f"{100 * found.values('map.accuracy.max', 'ir-room', config)[:runs].max():.3g}"

        for name, published, key, scale in (
            ("mean, cm", 3.376, "mean", 1e2),
            ("variance, cm2", 19.636, "var", 1e4),
        ):
            ours = both(lambda c, k=key, s=scale, f=figure: f(k, s, c))
            rows.append((name + suffix, None if suffix else published, *ours, seeds))
        for runs, published in ((PUBLISHED_RUNS, PUBLISHED_LARGEST_CM), (len(found.seeds), None)):
            if runs > len(found.seeds):
                continue
            ours = both(lambda c, r=runs, f=largest: f(r, c))
            name = f"largest of {runs} runs, cm{suffix}"
            rows.append((name, None if suffix else published, *ours, seeds_text(found.seeds[:runs])))
    pictures = [
        PagePicture(
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
    """A sentence on which of the paper's three figures its form misses here, and on outliers of single cells."""
    values = {key: found.values(f"map.accuracy.{key}", "ir-room", "paper") for key in ("mean", "var", "max")}
    far = 1e2 * values["max"] > PUBLISHED_LARGEST_CM
    checks = {
        "mean": 1e2 * values["mean"].mean() > 3.376,
        "variance": 1e4 * values["var"].mean() > 19.636,
        "largest error": bool(far[:PUBLISHED_RUNS].any()),
    }
    names = [name for name, is_missed in checks.items() if is_missed]
    parts = [FALLS_SHORT.format(what=" and ".join(names))] if names else []
    if far.any() and far.mean() <= 0.2:
        runs = int(far.sum())
        have = "has" if runs == 1 else "have"
        parts.append(LONE.format(runs=runs, all=len(far), have=have, largest=1e2 * values["max"].max()))
    return " ".join(parts)


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
