"""Signals at random moments: `python -m tests.fuzz.signals [SIGNALS [SEED [COMMAND...]]]` prints a table of them.

Each command gets SIGINT, SIGTERM or SIGHUP, once or twice, alone or with its whole process group as from a terminal, at any
moment of its run; the first and the last moments are drawn more often. Right is: the exit code and the last line agree with what
is left, every line is the program's own, and neither files nor processes remain.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from tests.conftest import REPOSITORY
from tests.fuzz.kills import SAMPLES, Command, clear, commands, contents

BIRTH_S = 0.06  # while the interpreter itself starts, a signal ends it as the system does
EDGE_S = 0.5  # the first and the last moments
LONGEST_S = 60.0
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
ROW = "{:10} {:>7} {:>18} {:>6} {:>12} {:>9} {:>9}\n"


def all_commands(folder: Path) -> Mapping[str, Command]:
    """Those that are killed, and others that end quickly."""
    found = dict(commands(folder))
    sweep = found.pop("sweep")
    two = (*sweep.arguments[:-1], "2")
    truth = str(SAMPLES / "slam-sd.truth")
    ends = ("--start", "1,1,0", "--goal", "2,2")
    return {
        **found,
        "sweep": Command(two, sweep.output, continues=True),
        "plan": Command(("plan", f"{truth}/map.yaml", *ends, "-o", "OUT"), "out"),
        "evaluate": Command(("evaluate", str(folder / "earlier"), "--truth", truth, "-o", "OUT"), "out"),
        "info": Command(("info", str(SAMPLES / "slam-sd.mcap"), "--check"), "out"),
        "preview": Command(("simulate", "office", "--preview", "OUT"), "out.png"),
        "maps": Command(("maps", "rotate", f"{truth}/map.yaml", "-o", "OUT", "--yaw", "0.3"), "out"),
    }


def start(command: Command, place: Path, scratch: Path) -> subprocess.Popen[str]:
    """The installed program in a session of its own, with a temporary folder of its own."""
    words = [word.replace("OUT", str(place / command.output)) for word in command.arguments]
    return subprocess.Popen(
        [str(Path(sys.executable).with_name("gridslam")), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,
        env={**os.environ, "TMPDIR": str(scratch)},
        start_new_session=True,
    )


def moment(duration_s: float, rng: random.Random) -> float:
    """Seconds after the start."""
    first, last = rng.uniform(BIRTH_S, EDGE_S), rng.uniform(duration_s - EDGE_S, duration_s)
    return max(BIRTH_S, rng.choice((first, last, rng.uniform(0.0, duration_s), rng.uniform(0.0, duration_s))))


def send(process: subprocess.Popen[str], number: int, to_all: bool) -> None:
    """To the process, or to all of its group, as a terminal does."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, number) if to_all else process.send_signal(number)


def alive_in(session: int) -> list[str]:
    """Names of the processes of a session."""
    names = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            name, _, rest = stat.read_text().rpartition(")")
            if int(rest.split()[3]) == session and rest.split()[0] != "Z":
                names.append(name)
    return names


def wrong(command: Command, place: Path, code: int, err: str, whole: Mapping[str, str], right: int) -> str:
    """What is wrong with the answer to a signal; no text if nothing is."""
    lines = err.splitlines()
    found = contents(place)
    hidden = [p.name for p in place.rglob(".*") if p.name != ".lock"]
    if hidden:
        return f"left {hidden}"
    if any(not line.startswith("gridslam: ") for line in lines):
        return "a line that is not the program's"
    if code == right and (found.keys() == whole.keys()):
        return ""
    if code != 130:
        return f"exit code {code}, {len(found)} of {len(whole)} files"
    last = lines[-1] if lines else ""
    if "interrupted" not in last:
        return "no line that says so"
    if "nothing was written" in last or last.endswith("error: interrupted"):
        return "" if command.continues or not found else f"{len(found)} files, and says there are none"
    if command.continues:
        return ""
    report = place / command.output / "report.json"
    return (
        "" if report.exists() and json.loads(report.read_text())["status"] == "interrupted" else "no report"
    )


def check(name: str, command: Command, folder: Path, count: int, rng: random.Random) -> list[str]:
    """Send signals to one command; returns the problems."""
    place, scratch = folder / f"{name}-signalled", folder / f"{name}-scratch"
    place.mkdir()
    scratch.mkdir()
    started = time.monotonic()
    process = start(command, place, scratch)
    process.communicate()
    duration_s, right, whole = time.monotonic() - started, process.returncode, contents(place)
    problems: list[str] = []
    codes = {130: 0, right: 0}
    for _ in range(count):
        clear(place)
        first, second = rng.choice(SIGNALS), rng.choice(SIGNALS)
        to_all, at_s = rng.random() < 0.5, moment(duration_s, rng)
        gap_s = rng.choice((None, None, 0.0, rng.uniform(0.0, 0.02), rng.uniform(0.0, 0.4)))
        what = f"{name}: {first.name} at {at_s:.3f} of {duration_s:.1f} s, then {gap_s and second.name} {gap_s}, all {to_all}"
        process = start(command, place, scratch)
        time.sleep(at_s)
        send(process, first, to_all)
        if gap_s is not None:
            time.sleep(gap_s)
            send(process, second, to_all)
        try:
            _, err = process.communicate(timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            problems.append(f"{what}: hangs")
            continue
        code = process.returncode
        codes[code] = codes.get(code, 0) + 1
        time.sleep(0.05)
        problem = wrong(command, place, code, err, whole, right)
        if left := alive_in(process.pid):
            problem += f" alive: {left}"
        if left := [path.name for path in scratch.iterdir()]:
            problem += f" in the temporary folder: {left}"
            clear(scratch)
        if problem:
            problems.append(f"{what}: {problem}: {code} {err[-1500:]!r}")
    others = sum(codes.values()) - codes[130] - codes[right]
    sys.stdout.write(
        ROW.format(name, count, f"{duration_s:.1f}", codes[right], codes[130], others, len(problems))
    )
    sys.stdout.flush()
    return problems


def main(arguments: list[str]) -> int:
    """Send signals to all commands; the number of problems."""
    count = int(arguments[0]) if arguments else 12
    rng = random.Random(int(arguments[1]) if len(arguments) > 1 else 0)
    names = arguments[2:]
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as made:
        sys.stdout.write(
            ROW.format(
                "command", "signals", "undisturbed run, s", "whole", "interrupted", "other", "problems"
            )
        )
        for name, command in all_commands(Path(made)).items():
            if name in names or not names:
                problems += check(name, command, Path(made), count, rng)
    sys.stdout.write("".join(f"PROBLEM {problem}\n" for problem in problems) or "nothing wrong\n")
    return len(problems)


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
