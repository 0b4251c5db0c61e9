"""Fuzz by structure: `python -m tests.fuzz.many INPUTS [SEED [TARGET...]]` runs that number of inputs of each target.

A target runs in a process of its own, thousands of inputs each, under limits. Whatever is neither a result nor a GridslamError,
takes more than LONGEST_S of CPU time or MAX_MB above the start, or writes on stdout or stderr, is printed with the
seed that makes it again: `python -m tests.fuzz.many 1 SEED TARGET`.
"""

from __future__ import annotations

import logging
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

LONGEST_S, LONGEST_WALL_S, MAX_MB = 10, 120, 1024


class Hang(BaseException):
    """An input took too long; no `except Exception` hides it."""


def run(target: str, inputs: int, seed: int) -> int:
    """Run the inputs of a target in this process; returns the number of bugs."""
    from tests.fuzz.structures import STRUCTURES

    act = STRUCTURES[target]
    logging.getLogger("gridslam").addHandler(logging.NullHandler())  # the program's own remarks are not noise
    out = os.fdopen(os.dup(1), "w", buffering=1)
    counts: Counter[str] = Counter()
    bugs: Counter[str] = Counter()
    signal.signal(signal.SIGPROF, _hang)
    with tempfile.TemporaryDirectory() as name, tempfile.TemporaryFile() as noise:
        os.dup2(noise.fileno(), 1)
        os.dup2(noise.fileno(), 2)
        for number in range(seed, seed + inputs):
            out.write(f"at {number}\n")
            problem = ""
            signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
            # A hang in compiled code ends the process: the parent goes on behind it
            signal.alarm(LONGEST_WALL_S)
            before = noise.seek(0, os.SEEK_END)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    counts[act(random.Random(f"{target} {number}"), Path(name))] += 1
            except (Exception, Hang):
                problem = traceback.format_exc(limit=-4)
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
            if noise.seek(0, os.SEEK_END) > before and not problem:
                noise.seek(before)
                problem = f"noise: {noise.read(300)!r}"
            if problem:
                sign = _sign(problem)
                bugs[sign] += 1
                counts["BUG"] += 1
                if bugs[sign] <= 2:
                    out.write(f"{target} seed {number}: {problem}\n")
            elif number == seed + min(20, inputs // 2):  # libraries are loaded by now
                _limit_memory()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    out.write(f"{target:11} {sum(counts.values())} inputs, {peak} MB: {dict(sorted(counts.items()))}\n")
    for sign, count in bugs.most_common():
        out.write(f"  {count} x {sign}\n")
    return sum(bugs.values())


def _hang(number: int, frame: object) -> None:
    raise Hang


def _sign(problem: str) -> str:
    """The last line and the innermost place, without numbers: equal for inputs that fail alike."""
    place = re.findall(r'File "[^"]*/([^"/]+)", line (\d+)', problem)
    return f"{problem.strip().splitlines()[-1][:100]} at {place[-1] if place else '?'}"


def _limit_memory() -> None:
    """From now on a memory of MAX_MB more than now is an error."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    highest = pages * resource.getpagesize() + (MAX_MB << 20)
    resource.setrlimit(resource.RLIMIT_AS, (highest, resource.RLIM_INFINITY))


def run_apart(target: str, inputs: int, seed: int) -> int:
    """Run a target in processes of its own: where one dies, the next goes on behind the deadly input.

    They are forks of this process, which has loaded the program once for all targets.
    """
    bugs, end = 0, seed + inputs
    while seed < end:
        reading, writing = os.pipe()
        if not (child := os.fork()):
            os.dup2(writing, 1)
            os._exit(min(run(target, end - seed, seed), 1))
        os.close(writing)
        last = seed
        with os.fdopen(reading, errors="replace") as lines:
            for line in lines:
                if match := re.fullmatch(r"at (\d+)\n", line):
                    last = int(match[1])
                else:
                    sys.stdout.write(line)
                    sys.stdout.flush()
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code in (0, 1):
            return bugs + code
        sys.stdout.write(f"{target} seed {last}: the process ended with {code}\n")
        bugs, seed = bugs + 1, last + 1
    return bugs


def main(arguments: list[str]) -> int:
    """Run all targets, or those that are named; 1 if there was a bug."""
    from tests.fuzz.structures import STRUCTURES

    inputs = int(arguments[0]) if arguments else 100
    seed = int(arguments[1]) if len(arguments) > 1 else 0
    started = time.monotonic()
    bugs = sum(run_apart(target, inputs, seed) for target in arguments[2:] or STRUCTURES)
    sys.stdout.write(f"{time.monotonic() - started:.0f} s\n")
    return min(bugs, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
