"""Hold a change that must not change results to that: digests of what the program writes, before and after.

`python -m tests.same_results record FILE.json` at the commit before, `python -m tests.same_results compare FILE.json` at
the one after; both in the root of a checkout, and both take the names of single runs. `record` replaces those of
the file and keeps the rest. Names of files, keys and columns may differ, and pictures with labels, reports and settings;
files may be added.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.conftest import REPOSITORY
from tests.same_results.digests import digests_of_folder
from tests.same_results.programs import commands, write_sweep

Digests = dict[str, str]


def main(arguments: Sequence[str] | None = None) -> int:
    """Record or compare; 1 where a result differs or a run fails."""
    names = list(commands(Path(), 1))
    parser = argparse.ArgumentParser(prog="python -m tests.same_results")
    parser.add_argument("action", choices=("record", "compare"))
    parser.add_argument("file", type=Path, metavar="FILE.json")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"absent: all of {', '.join(names)}")
    parser.add_argument(
        "--jobs", type=int, default=2, help="runs at a time; they share the cores (default 2)"
    )
    parser.add_argument(
        "--keep", type=Path, metavar="DIR", help="a new folder that keeps what the runs write"
    )
    given = parser.parse_intermixed_args(arguments)
    if unknown := [name for name in given.names if name not in names]:
        parser.error(f"no run {unknown[0]!r}; there are: {', '.join(names)}")
    if given.action == "compare" and not given.file.exists():
        parser.error(f"{given.file}: no such file; record it first, at the commit before the change")
    if given.keep and given.keep.exists():
        parser.error(f"{given.keep}: is there already; choose another folder for --keep")
    known: dict[str, Digests] = json.loads(given.file.read_text()) if given.file.exists() else {}
    bad = 0
    with tempfile.TemporaryDirectory() as temporary:
        for name, found in run_all(given.names or names, given.keep or Path(temporary), given.jobs):
            if found is None:
                lines = ["failed"]
            elif given.action == "compare" and name not in known:
                lines = [f"missing in {given.file}"]
            elif given.action == "record":
                known[name] = found
                given.file.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
                lines = [f"recorded {len(found)} items"]
            else:
                lines = comparison(known[name], found)
            bad += sum(not line.startswith(("same", "new", "recorded")) for line in lines)
            sys.stdout.writelines(f"{name:18} {line}\n" for line in lines)
            sys.stdout.flush()
    sys.stdout.write(f"{bad} not the same\n" if bad else "nothing differs\n")
    return int(bad > 0)


def comparison(known: Digests, found: Digests) -> list[str]:
    """A line for each item: `same`, also under a new name of the same suffix; `differs`; `missing`; `new`."""
    lines = []
    new = {name: digest for name, digest in found.items() if name not in known}
    for name, digest in known.items():
        renamed = next((other for other in new if new[other] == digest and _kind(other) == _kind(name)), None)
        if name in found:
            lines.append(f"{'same' if found[name] == digest else 'differs'} {name}")
        elif renamed is not None:
            del new[renamed]
            lines.append(f"same {name}, now {renamed}")
        else:
            lines.append(f"missing {name}")
    return lines + [f"new {name}" for name in new]


def _kind(name: str) -> str:
    return name.rpartition(".")[2]


def run_all(names: Sequence[str], folder: Path, jobs: int) -> Iterator[tuple[str, Digests | None]]:
    """Make the named runs, `jobs` at a time; their digests, None for a run that failed."""
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    write_sweep(folder)
    made = commands(folder, threads=max(1, (os.cpu_count() or 1) // jobs))
    with ThreadPoolExecutor(jobs) as pool:
        digests = pool.map(run_one, [folder / name for name in names], [made[name] for name in names])
        yield from zip(names, digests, strict=True)


def run_one(folder: Path, command: list[str]) -> Digests | None:
    """Make one run and digest what it wrote into its folder; None, and why on stderr, if it failed."""
    started = time.perf_counter()
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True)
    sys.stderr.write(f"{folder.name}: {time.perf_counter() - started:.0f} s\n")
    if done.returncode:
        sys.stderr.write(f"{' '.join(command)}\n{done.stderr}")
        return None
    return digests_of_folder(folder)


if __name__ == "__main__":
    sys.exit(main())
