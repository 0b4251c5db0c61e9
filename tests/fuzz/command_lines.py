"""Whole command lines over damaged inputs: whatever a user may give ends with an exit code of its own and our lines alone."""

from __future__ import annotations

import contextlib
import io
import json
import random
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.cli.main import main
from gridslam.methods import registry
from gridslam.runs.run_config import run_config_model
from tests.fuzz import log_records
from tests.fuzz.damage import NUMBERS, changed
from tests.fuzz.map_files import write_odd_map
from tests.fuzz.odd_drives import write_odd_drive
from tests.fuzz.session_files import damaged_session
from tests.fuzz.value_trees import resolved
from tests.small_log import write_small_log

CODES = {0: "done", 1: "gate", 2: "usage", 3: "input", 4: "method", 5: "doubtful"}
MAX_STDERR_LINES, MAX_LINE = 40, 2100
TEXTS = (
    "", " ", "nan", "-inf", "1e400", "0", "-1", "1e-300", "1e12", "1,2", "0,0,0", "nan,0,0", "1e300,1e300,0", "1,2,3,4",
    "[", "{a: 1}", "~", "\udcff", "\x1b[31m", "a\nb", "true", "1:30", "&a [*a]", "x" * 5000, "9" * 5000,
)  # fmt: skip
POSES = "".join(f"{1_400_000_000 + i}.5 {i} {i % 3} 0 0 0 0 1\n" for i in range(1, 12))
EUROC = "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n"


def command(*arguments: str) -> str:
    """The outcome of a command line in this process.

    Only exit codes that are promised and lines that begin as ours, printable and no longer than a screen, are right.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    lines = err.getvalue().split("\n")
    assert code in CODES, err.getvalue()[-600:]
    assert code == 0 or err.getvalue(), "a failure says something"
    assert len(lines) <= MAX_STDERR_LINES, lines[:5]
    assert all(line.startswith("gridslam: ") for line in lines[:-1]), lines[:5]
    assert all(line.isprintable() and len(line) <= MAX_LINE for line in lines), lines[:5]
    if "--json" in arguments and code in (0, 1):
        json.loads(out.getvalue())
    return CODES[code]


def _cells(rows: list[list[str]], rng: random.Random) -> list[list[str]]:
    """Rows of a table with a few changed cells, rows repeated or cut."""
    rows = [list(row) for row in rows]
    for _ in range(rng.choice((0, 0, 1, 3))):
        row = rng.choice(rows)
        if row and rng.random() < 0.8:
            row[rng.randrange(len(row))] = rng.choice((*NUMBERS, "1e19", "-5", "0x1", "\u0661", "#", "1e-9"))
        else:
            rows[rng.randrange(len(rows))] = rng.choice(([], ["#"], row * 2, row[:-1], row))
    return rows


def _trajectory(path: Path, rng: random.Random) -> Path:
    """A trajectory of any text format, or a log of its own; some are damaged."""
    tum = [line.split() for line in POSES.splitlines()]
    kitti = [["1", "0", "0", str(i), "0", "1", "0", "0", "0", "0", "1", str(i % 3)] for i in range(11)]
    euroc = [
        [f"{1_400_000_000 + i}500000000", str(i), str(i % 3), "0", "1", "0", "0", "0"] for i in range(1, 12)
    ]
    suffix, separator, head, rows = rng.choice(
        (
            (".tum", " ", "", tum),
            (".txt", " ", "", kitti),
            (".csv", ",", EUROC, euroc),
            (".csv", ",", "stamp,x,y,yaw\n", [[r[0], r[1], r[2], "0"] for r in tum]),
        )
    )
    path = path.with_suffix(suffix)
    body = "\n".join(separator.join(row) for row in _cells(rows, rng)) + "\n"
    data = (head + body).encode("utf-8")
    path.write_bytes(changed(data, rng) if rng.random() < 0.2 else data)
    return path


def evaluate(rng: random.Random, folder: Path) -> str:
    """`evaluate` of text formats and of poses in logs, with options that fit badly."""
    arguments = []
    for name in ("result", "truth"):
        if rng.random() < 0.25:
            sample = folder / "sample.mcap"
            if not sample.exists():
                log_records.write_sample(sample)
            kind = rng.choice(("mcap", "db3", "bag"))
            path = log_records.MAKERS[kind](folder / f"{name}.{kind}", sample, rng)
            topic = rng.choice(
                ("/odom", "/pose", "/ground_truth", "odom->wheel", "base_link->laser", "a->a", "->", "/scan")
            )
            option = "--topic" if name == "result" else "--truth-topic"
            arguments += [option, topic]
        else:
            path = _trajectory(folder / name, rng)
        arguments += [str(path)] if name == "result" else ["--truth", str(path)]
    if rng.random() < 0.2:
        rows = _cells([["1.5", "3.5", "2", "0", "0", "0", "0", "0"]] * 3, rng)
        (folder / "true.relations").write_text("\n".join(map(" ".join, rows)) + "\n")
        arguments += ["--relations", str(folder / "true.relations")]
    numbers = ("0", "nan", "-1", "1", "0.5", "1e300", "5", "1e-12")
    options = {
        "--align": ("none", "se2", "origin", "x"),
        "--sync": ("nearest", "interpolate"),
        "--delta": numbers,
        "--delta-unit": ("frames", "metres", "seconds"),
        "--time-offset": (*numbers, "9e9"),
        "--max-difference": numbers,
        "--max-gap": numbers,
        "--require": ("ape.trans.rmse<=1", "x<1", "ape.trans.rmse<=nan", "ape.trans.rmse", "\x1b<1"),
    }
    for option in rng.sample(list(options), rng.choice((0, 0, 0, 1, 2))):
        arguments += [option, rng.choice(options[option])]
    arguments += rng.choice(([], ["--all"], ["--json"], ["--align", "se2", "--scale"]))
    if rng.random() < 0.15:
        arguments += ["-o", str(folder / "page"), "--force"]
    return command("evaluate", *arguments)


def maps(rng: random.Random, folder: Path) -> str:
    """`maps`, `plan` and `correlation` over odd maps and pictures, with odd numbers."""
    first = str(write_odd_map(folder / "one", rng))
    second = str(write_odd_map(folder / "two", rng))
    three = rng.choice(("0,0,0", "0.1,0.1,0.2", "1,-1,3", "1e6,0,0", rng.choice(TEXTS)))
    two = rng.choice(("0.1,0.1", "0.5,0.5", "0.07,0.07", "1e300,0", rng.choice(TEXTS)))
    corners = " ".join(
        rng.choice(("0,0", "1,0", "1,1", "0,1", "-1e9,0", "1e300,1e300"))
        for _ in range(rng.choice((2, 3, 4, 9)))
    )
    new = str(folder / rng.choice(("new.yaml", "new.yaml", "new.png", "new")))
    exported = str(folder / rng.choice(("new.yaml", "new.svg", "new.dxf", "new.tif", "new.txt")))
    goal, epsg = (
        rng.choice(("0.1,0.1", "1,1,0", rng.choice(TEXTS))),
        rng.choice(("32632", "32632", "0", "99999999")),
    )
    mode = ["--mode", rng.choice(("trinary", "scale", "raw"))]
    extents = ("0.2", "0", "1", "nan", "-1", "1e300", "1e-300", "50")
    driving = [
        "--radius",
        "--min-radius",
        "--margin",
        "--speed",
        "--lateral",
        "--turn-rate",
        "--acceleration",
    ]
    robot = [f"{option}={rng.choice(extents)}" for option in rng.sample(driving, rng.choice((0, 0, 1, 2)))]
    shape = [f"--footprint={corners}"] if rng.random() < 0.2 else []
    chosen = rng.choice(
        (
            ["maps", "crop", first, "-o", new, f"--polygon={corners}", *mode, "--force"],
            ["maps", "crop", first, "-o", new, f"--reachable={two}", *mode, "--force"],
            ["maps", "rotate", first, "-o", new, *mode, "--force"],
            ["maps", "rotate", first, "-o", new, f"--yaw={rng.choice(('90', '33', '1e300', *TEXTS))}", "--force"],
            ["maps", "merge", first, second, "-o", new, "--force"],
            ["maps", "merge", first, second, "-o", new, f"--pose={three}", *mode, "--force"],
            ["maps", "compare", first, second, "--json"],
            ["maps", "compare", first, second, f"--pose={three}", "-o", str(folder / "both.png"), "--force"],
            ["maps", "export", first, "-o", exported, *mode, "--force", "--epsg", epsg, f"--geo-origin={two}"],
            ["plan", first, f"--start={three}", f"--goal={goal}", "-o", str(folder / "plan"), "--force", *robot, *shape],
            ["correlation", first],
        )
    )  # fmt: skip
    return f"{' '.join(chosen[: 1 + (chosen[0] == 'maps')])} {command(*chosen)}"


def _drawn_picture(rng: random.Random) -> NDArray[np.uint8]:
    """A plan of a few rooms `(rows, cols)`, or noise, or a picture of one grey."""
    rows, cols = rng.choice(((60, 80), (200, 300), (20, 900), (30, 30), (1, 1)))
    kind = rng.randrange(4)
    noise = np.random.default_rng(rng.randrange(999)).integers(0, 256, (rows, cols)).astype(np.uint8)
    if kind == 0:
        return noise
    cells = np.full((rows, cols), rng.choice((255, 255, 0, 128)), np.uint8)
    if kind > 1:
        for _ in range(rng.choice((1, 4, 30))):
            r, c = rng.randrange(rows), rng.randrange(cols)
            cells[r : r + rng.choice((1, 2, rows)), c : c + rng.choice((2, cols))] = rng.choice(
                (0, 0, 40, 255)
            )
    return cells


def drawing(rng: random.Random, folder: Path) -> str:
    """`drawing show` of plans, noise and damaged picture files."""
    mode = rng.choice(("L", "L", "RGB", "RGBA", "P", "1", "I;16", "F", "CMYK"))
    suffix = rng.choice((".png", ".png", ".jpg", ".pgm", ".bmp", ".gif", ".tif", ".webp"))
    cells = _drawn_picture(rng)
    path = folder / f"plan{suffix}"
    picture = (
        Image.fromarray(cells.astype(np.uint16) * 257)
        if mode == "I;16"
        else Image.fromarray(cells).convert(mode)
    )
    try:
        picture.save(path)
    except (OSError, ValueError, KeyError):
        Image.fromarray(cells).save(path)
    if rng.random() < 0.5:
        data = path.read_bytes()
        path.write_bytes(changed(data[:400], rng) + data[400:] if rng.random() < 0.7 else changed(data, rng))
    arguments = ["--walls-are", rng.choice(("auto", "auto", "dark", "bright"))]
    arguments += ["--max-gap", rng.choice(("0", "0.3", "0.3", "1", "1", "nan"))]
    arguments += ["--json"] if rng.random() < 0.5 else ["-o", str(folder / "read.png"), "--force"]
    return command("drawing", "show", str(path), *arguments)


def small_log(folder: Path, name: str = "small") -> Path:
    """A log that is mapped in a moment."""
    log = folder / name
    if not log.exists():
        write_small_log(log, scans=12, beams=60)
        for table in log.glob("*.csv"):  # each name on a day of its own
            table.write_text(table.read_text().replace("\n17", f"\n1{7 + len(name) % 3}"))
    return log


def run(rng: random.Random, folder: Path) -> str:
    """A map of a drive whose numbers contradict each other, some measured by a truth, or a localization of it."""
    log, output = str(write_odd_drive(folder / "odd", rng)), str(folder / "out")
    chosen = rng.choice(("map slam-sd", "map slam-sd", "map handmap-slam", "localize ispace-mcl"))
    name, method = chosen.split()
    arguments = [
        name,
        log,
        "-c",
        method,
        "-o",
        output,
        "--force",
        *rng.choice(([], ["--json"], ["--strict"])),
    ]
    if name == "localize":
        arguments += ["--map", str(_session(folder)), *rng.choice(([], ["--start", "1,0,1.57"]))]
    if rng.random() < 0.5:
        arguments += ["--set", "output.viewer=true"]
    if rng.random() < 0.3:
        arguments += ["--truth", str(_trajectory(folder / "truth", rng))]
    return f"{chosen} {command(*arguments)}"


def _session(folder: Path) -> Path:
    """A run of slam-sd with its session."""
    run = folder / "earlier"
    if not run.exists():
        assert command("map", str(small_log(folder)), "-c", "slam-sd", "-o", str(run)) in ("done", "method")
    return run


def session(rng: random.Random, folder: Path) -> str:
    """A damaged session continued by a log, or localized on."""
    run = _session(folder)
    place = folder / "damaged"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(run, place)
    file = place / "session.npz"
    file.write_bytes(damaged_session((run / "session.npz").read_bytes(), rng))
    log, output = str(small_log(folder, "again")), str(folder / "out")
    if rng.random() < 0.1:
        arguments = ["localize", log, "-c", "ispace-mcl", "--map", str(place)]
    else:
        arguments = ["map", log, "-c", "slam-sd", "--continue", str(rng.choice((place, file)))]
    return f"{arguments[0]} {command(*arguments, '-o', output, '--force')}"


@cache
def leaves(name: str) -> list[str]:
    """Key paths of all settings of a method."""
    schema = run_config_model(name).model_json_schema()

    def below(part: dict[str, Any], path: str) -> list[str]:
        part = resolved(part, schema, random.Random(0))
        keys = part.get("properties", {})
        return [
            leaf for key, value in keys.items() for leaf in below(value, f"{path}.{key}".lstrip("."))
        ] or [path]

    return below(schema, "")


def options(rng: random.Random, folder: Path) -> str:
    """Values of `--set` and of other options of commands."""
    name = rng.choice(list(registry.BUILT_IN))
    keys = leaves(name)
    sets = []
    for _ in range(rng.choice((1, 2, 3))):
        key = rng.choice(
            (
                rng.choice(keys),
                rng.choice(keys),
                rng.choice(keys) + ".x",
                "",
                ".",
                "method",
                "log..topics",
                "__class__",
            )
        )
        value = rng.choice((*TEXTS, *NUMBERS, "3", "0.5"))
        sets += ["--set", rng.choice((f"{key}={value}", f"{key}={value}", f"{key}={value}", f"{key}{value}"))]
    if rng.random() < 0.7:
        return f"config {command('config', rng.choice(('show', 'check')), name, *sets)}"
    log, output = str(small_log(folder)), str(folder / "out")
    times = [
        f"{option}={rng.choice(TEXTS)}"
        for option in rng.sample(["--start", "--end", "--seed", "--jobs"], rng.randrange(3))
    ]
    kind = rng.choice(("map", "map", "convert", "info", "simulate"))
    few = sets[:2] if name == "slam-sd" else []
    longest = f"max_duration_s={rng.choice(('0', 'nan', '1e-9', 'x', '-1'))}"
    line = {
        "map": ["map", log, "-c", "slam-sd", *few, "-o", output, "--force", *times],
        "convert": ["convert", log, str(folder / "c.mcap"), "--force", *[t for t in times if t[2] in "se"]],
        "info": ["info", log, *rng.choice(([], ["--json"], ["-c", name, *sets]))],
        "simulate": ["simulate", "ir-room", "-o", str(folder / "s.mcap"), "--force", "--set", longest],
    }[kind]  # fmt: skip
    return f"{kind} {command(*line)}"


TARGETS = {
    "evaluate": evaluate,
    "maps": maps,
    "drawing": drawing,
    "session": session,
    "options": options,
    "run": run,
}
