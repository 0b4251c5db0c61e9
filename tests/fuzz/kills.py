"""Kill commands at random moments: `python -m tests.fuzz.kills [KILLS [SEED [COMMAND...]]]` prints a table of them.

Each command is ended by SIGKILL at random moments of its run. Its output then is absent or whole, and the next run of the same
command, in the same place, gives the bytes of a run that nobody disturbed. Then two of each run at the same time: one
succeeds, the other says why it does not.
"""

from __future__ import annotations

import hashlib
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gridslam.logs.convert import convert_log
from gridslam.logs.open import open_log
from gridslam.simulation.record import UNFINISHED, truth_folder
from tests.conftest import REPOSITORY, program_command

SAMPLES = REPOSITORY / "sample_logs"
SECONDS = 6.0  # of the logs
AGAIN_EVERY = 4  # kills between undisturbed runs
TRIALS = 5  # of two runs at once: on a busy machine one may be over before the other begins
ROW = "{:10} {:>7} {:>18} {:>15} {:>9}\n"
CHANGING = (".json", ".html", "costs.csv")  # ends of the names of files with times and memory
WORLD = """
walls: [{rectangle: [0, 0, 8, 6]}]
robot: {start: [1, 1, 0], route: [[6, 1], [6, 4]]}
sensors: {lidar: {}, odometry: {}}
"""
SWEEP = "command: map\nlogs: [{log: LOG}]\nconfigs: [slam-sd]\nseeds: 0..1\n"


@dataclass(frozen=True)
class Command:
    """Arguments with OUT for the output, the output's name, and whether an unfinished output may be seen."""

    arguments: tuple[str, ...]
    output: str
    continues: bool = False


def commands(folder: Path) -> Mapping[str, Command]:
    """The commands, on small inputs that are made in the folder."""
    logs = {name: _beginning(SAMPLES / f"{name}.mcap", folder) for name in ("slam-sd", "ispace-mcl")}
    again = _beginning(SAMPLES / "slam-sd.mcap", folder, 2.0 * SECONDS, SECONDS, "again.mcap")
    earlier = folder / "earlier"
    subprocess.run(
        program_command("map", logs["slam-sd"], "-c", "slam-sd", "-o", earlier),
        check=True,
        capture_output=True,
    )
    (folder / "world.yaml").write_text(WORLD)
    (folder / "sweep.yaml").write_text(SWEEP.replace("LOG", logs["slam-sd"]))
    true_map = str(SAMPLES / "ispace-mcl.truth" / "map.yaml")
    drawing = str(REPOSITORY / "configs" / "worlds" / "drawings" / "corridor.png")
    explore = ("explore", "hand-corridor-20", "--drawing", drawing, "-o", "OUT", "--longest", "6")
    return {
        "map": Command(("map", logs["slam-sd"], "-c", "slam-sd", "-o", "OUT"), "out"),
        "localize": Command(
            ("localize", logs["ispace-mcl"], "-c", "ispace-mcl", "--map", true_map, "-o", "OUT"), "out"
        ),
        "convert": Command(("convert", logs["slam-sd"], "OUT"), "out"),
        "simulate": Command(("simulate", str(folder / "world.yaml"), "-o", "OUT"), "out.mcap"),
        "explore": Command(explore, "out"),
        "continued": Command(("map", again, "-c", "slam-sd", "--continue", str(earlier), "-o", "OUT"), "out"),
        "sweep": Command(
            ("sweep", str(folder / "sweep.yaml"), "-o", "OUT", "--jobs", "1"), "out", continues=True
        ),
    }


def _beginning(log: Path, folder: Path, end_s: float = SECONDS, start_s: float = 0.0, name: str = "") -> str:
    """A few seconds of a sample log."""
    path = folder / (name or log.name)
    with open_log(log) as opened:
        convert_log(opened, path, start_s=start_s, end_s=end_s)
    return str(path)


def start(command: Command, folder: Path, *further: str) -> subprocess.Popen[str]:
    """The command as a process that writes into the folder."""
    arguments = [part.replace("OUT", str(folder / command.output)) for part in command.arguments]
    arguments += further
    return subprocess.Popen(
        program_command(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder
    )


def contents(folder: Path) -> dict[str, str]:
    """A hash of each file that anybody sees; of files that hold times and memory the name alone."""
    files = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    shown = {
        name: path for name, path in files.items() if not any(p.startswith(".") for p in Path(name).parts)
    }
    return {
        name: "" if name.endswith(CHANGING) else hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in shown.items()
    }


def half_made(command: Command, folder: Path, whole: Mapping[str, str]) -> str:
    """What is wrong with the outputs after a kill; no text if nothing is."""
    found = contents(folder)
    if command.continues or found == whole:
        return ""
    log = folder / command.output
    if truth_folder(log).exists() and (truth_folder(log) / UNFINISHED).exists() and not log.exists():
        return ""  # a truth that waits for its log
    return (
        ""
        if not found
        else f"{len(found)} of {len(whole)} files: {sorted(found.items() ^ whole.items())[:3]}"
    )


def check(name: str, command: Command, folder: Path, kills: int, rng: random.Random) -> list[str]:
    """Kill one command; returns the problems."""
    problems: list[str] = []
    reference = folder / f"{name}-whole"
    reference.mkdir()
    started = time.monotonic()
    process = start(command, reference)
    _, err = process.communicate()
    duration_s = time.monotonic() - started
    if process.returncode not in (0, 4):
        return [f"{name}: the undisturbed run ends with {process.returncode}: {err}"]
    whole, code = contents(reference), process.returncode
    place = folder / f"{name}-killed"
    place.mkdir()
    seen = 0
    for kill in range(kills):
        process = start(command, place)
        time.sleep(rng.uniform(0.0, 1.1 * duration_s))
        process.kill()
        process.communicate()
        if problem := half_made(command, place, whole):
            problems.append(f"{name}: half made after kill {kill}: {problem}")
        seen += bool(contents(place))
        if kill % AGAIN_EVERY == AGAIN_EVERY - 1 or kill == kills - 1:
            problems += _again(name, command, place, whole, code)
    sys.stdout.write(ROW.format(name, kills, f"{duration_s:.1f}", seen, len(problems)))
    sys.stdout.flush()
    return problems


def _again(name: str, command: Command, place: Path, whole: Mapping[str, str], code: int) -> list[str]:
    """The next run, after what is whole has been put away."""
    if not command.continues and contents(place) == whole:
        clear(place)
    process = start(command, place)
    _, err = process.communicate()
    found = contents(place)
    clear(place)
    if process.returncode == code and found == whole:
        return []
    return [f"{name}: the next run ends with {process.returncode}, {len(found)} of {len(whole)} files: {err}"]


def clear(place: Path) -> None:
    shutil.rmtree(place)
    place.mkdir()


def two_at_once(name: str, command: Command, folder: Path, *further: str) -> list[str]:
    """Run a command twice at the same time, over an earlier output with `--force`; returns the problems."""
    for trial in range(TRIALS):
        place = folder / f"{name}-twice{''.join(further)}{trial}"
        place.mkdir()
        if further:
            start(command, place).communicate()
        both = [start(command, place, *further) for _ in range(2)]
        errors = [process.communicate()[1] for process in both]
        codes = [process.returncode for process in both]
        if codes != [0, 0]:
            break
    spoken = [err for code, err in zip(codes, errors, strict=True) if code == 2 and "error: " in err]
    if len(spoken) == 1 and contents(place) == contents(folder / f"{name}-whole"):
        return []
    return [f"{name} {further}: two at once end with {codes}: {errors}"]


def main(arguments: list[str]) -> int:
    """Kill all commands; the number of problems."""
    kills = int(arguments[0]) if arguments else 17
    rng = random.Random(int(arguments[1]) if len(arguments) > 1 else 0)
    names = arguments[2:]
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as made:
        sys.stdout.write(ROW.format("command", "killed", "undisturbed run, s", "with an output", "problems"))
        for name, command in commands(Path(made)).items():
            if name in names or not names:
                problems += check(name, command, Path(made), kills, rng)
                problems += two_at_once(name, command, Path(made))
                if not command.continues:
                    problems += two_at_once(name, command, Path(made), "--force")
    sys.stdout.write("".join(f"PROBLEM {problem}\n" for problem in problems) or "nothing half made\n")
    return len(problems)


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
