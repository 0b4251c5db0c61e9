"""`gridslam plan` from corner to corner of maps of 10,000 x 10,000 cells: CPU time and memory of the whole command.

The maps: a maze of corridors of 5 m, a field with boxes, buildings of rooms with doors of 1 m, and rooms with noise (one
cell in 2,000 occupied). A path must be found on each of them. A robot that
cannot turn in the rooms is refused.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.harness import BenchmarkRow, say
from tests.conftest import program_command

ALONE = True
CELLS, RESOLUTION_M = 10_000, 0.05
FREE, OCCUPIED = 254, 0
START, GOAL = "2.5,2.5,0", "497.5,497.5,0"
MAX_CPU_S, MAX_MB = 10.0, 1500.0
RUNS = 2  # of which the faster counts: the rest is the machine's

Image = NDArray[np.uint8]


def rows() -> Iterator[BenchmarkRow]:
    """Per map: CPU time, largest memory, and whether a path was found."""
    for name, make in MAPS.items():
        with tempfile.TemporaryDirectory() as folder:
            save(make(np.random.default_rng(0)), Path(folder))
            runs = [plan(Path(folder)) for _ in range(RUNS)]
            cpu_s, memory_mb, found = min(runs)
            refused_cpu_s = plan(Path(folder), "--min-radius=2")[0] if name == "buildings" else None
        yield BenchmarkRow(f"plan_large.{name}.cpu", cpu_s, "s", MAX_CPU_S)
        yield BenchmarkRow(f"plan_large.{name}.memory", memory_mb, "MB", MAX_MB)
        yield BenchmarkRow(f"plan_large.{name}.found", found, "of 1", 1, at_least=True)
        if refused_cpu_s is not None:
            yield BenchmarkRow(f"plan_large.{name}.refused.cpu", refused_cpu_s, "s", MAX_CPU_S)


def plan(folder: Path, *options: str) -> tuple[float, float, bool]:
    """CPU time (s) and memory (MB) of the command in a process of its own, and whether it succeeds."""
    arguments = [
        "plan",
        folder / "map.yaml",
        f"--start={START}",
        f"--goal={GOAL}",
        "-o",
        folder / "out",
        "--force",
        *options,
    ]
    with (folder / "stderr").open("w") as stderr:
        process = subprocess.Popen(program_command(*arguments), stdout=subprocess.DEVNULL, stderr=stderr)
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = status
    if status:
        say((folder / "stderr").read_text())
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, status == 0


def save(image: Image, folder: Path) -> None:
    """A map_server pair; the first row of the array is the lowest of the map."""
    cv2.imwrite(str(folder / "map.png"), image[::-1])
    (folder / "map.yaml").write_text(
        f"image: map.png\nresolution: {RESOLUTION_M}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def maze(rng: np.random.Generator) -> Image:
    """A maze with one path between any two places, by depth-first search."""
    side, step, wall = 100, CELLS // 100, 4
    image = np.full((CELLS, CELLS), FREE, np.uint8)
    for line in range(0, CELLS + 1, step):
        image[max(line - wall, 0) : line + wall] = image[:, max(line - wall, 0) : line + wall] = OCCUPIED
    visited, stack = {(0, 0)}, [(0, 0)]
    while stack:
        row, col = stack[-1]
        around = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        new = [n for n in around if min(n) >= 0 and max(n) < side and n not in visited]
        if not new:
            stack.pop()
            continue
        chosen = new[rng.integers(len(new))]
        (r0, c0), (r1, c1) = np.minimum(stack[-1], chosen), np.maximum(stack[-1], chosen)
        image[r0 * step + wall : (r1 + 1) * step - wall, c0 * step + wall : (c1 + 1) * step - wall] = FREE
        visited.add(chosen)
        stack.append(chosen)
    return image


def field(rng: np.random.Generator) -> Image:
    """A field with 2,000 boxes of 0.5 to 8 m."""
    image = np.full((CELLS, CELLS), FREE, np.uint8)
    for _ in range(2000):
        row, col = rng.integers(200, CELLS - 200, 2)
        height, width = rng.integers(10, 160, 2)
        image[row : row + height, col : col + width] = OCCUPIED
    image[:200, :200] = image[-200:, -200:] = FREE
    return image


def buildings(rng: np.random.Generator) -> Image:
    """Rooms of 5 m with doors of 1 m in three of four walls, and corridors of 2.5 m every third row of rooms."""
    image = np.full((CELLS, CELLS), FREE, np.uint8)
    for row in range(0, CELLS, 100):
        for col in range(0, CELLS, 100):
            image[row : row + 4, col : col + 100] = image[row : row + 100, col : col + 4] = OCCUPIED
            at = rng.integers(10, 70, 2)
            doors = rng.random(2) < 0.75
            if doors[0]:
                image[row : row + 4, col + at[0] : col + at[0] + 20] = FREE
            if doors[1]:
                image[row + at[1] : row + at[1] + 20, col : col + 4] = FREE
        if row % 300 == 200:
            image[row + 4 : row + 54, 4:-4] = FREE
    image[:4] = image[-4:] = image[:, :4] = image[:, -4:] = OCCUPIED
    return image


def noise(rng: np.random.Generator) -> Image:
    """Rooms with single occupied cells at random."""
    image = buildings(rng)
    image[rng.random((CELLS, CELLS)) < 1.0 / 2000.0] = OCCUPIED
    image[20:90, 20:90] = image[-90:-20, -90:-20] = FREE
    return image


MAPS: Mapping[str, Callable[[np.random.Generator], Image]] = {
    "maze": maze,
    "field": field,
    "buildings": buildings,
    "noise": noise,
}
