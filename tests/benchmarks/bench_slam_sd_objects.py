"""slam-sd with tagged objects, in the simulated corridors with seeds 0 to 19; tuned on seeds from 100.

An object is right within 0.15 m and 15 degrees with its door's state right. Fewer seeds give a quick look:
`GRIDSLAM_BENCH_SEEDS=3`.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.tagged_worlds import JudgedObject, ObjectScore, mapped, simulated

SEEDS = range(int(os.environ.get("GRIDSLAM_BENCH_SEEDS", "20")))
FINE = ("method.map.resolution_m=0.02",)
BIN = "kind: bin, size: [0.4, 0.5]"
BESIDE = (
    f"objects=[{{id: bin-1, {BIN}, pose: [7.4, 0.22, 90], tag: {{id: tag-bin-1, position: [0.2, 0]}}}}, "
    f"{{id: bin-2, {BIN}, pose: [2.65, 2.78, -90], tag: {{id: tag-bin-2, position: [0.2, 0]}}}}]",
)


def rows() -> Iterator[BenchmarkRow]:
    """Every figure that the method's page names."""
    short = scores("sd-corridor-short", "slam-sd")
    yield BenchmarkRow("slam_sd.objects.short.right", min(o.right for o in short), "of 4", 4, at_least=True)
    beside = scores("sd-corridor-short", "slam-sd", BESIDE, "bins-beside-doors")
    yield BenchmarkRow("slam_sd.objects.beside.right", mean_right(beside), "of 4", 3.9, at_least=True)
    long = scores("sd-corridor-long", "slam-sd")
    yield BenchmarkRow("slam_sd.objects.long.right", mean_right(long), "of 24", 23.5, at_least=True)
    moved = scores("sd-corridor-long-moved", "slam-sd")
    yield BenchmarkRow("slam_sd.objects.moved.right", mean_right(moved), "of 24", 23.5, at_least=True)
    yield from moved_flags(moved)
    yield BenchmarkRow("slam_sd.objects.moved.ghosts", max(o.ghosts for o in moved), "of old cells", 0.02)
    yield BenchmarkRow(
        "slam_sd.objects.moved.shown", min(o.shown for o in moved), "of new cells", 0.9, at_least=True
    )
    plain = scores("sd-corridor-long-moved", "slam-sd", tags=False)
    still, with_tags, without = (mean_ape(found) for found in (long, moved, plain))
    say(
        f"trajectory, mean rmse (m): nothing moved {still:.4f}; moved {with_tags:.4f}; moved, no tags {without:.4f}"
    )
    yield BenchmarkRow("slam_sd.objects.moved.ape_per_still", with_tags / still, "x", 1.2)
    yield BenchmarkRow("slam_sd.objects.plain.ape_per_still", without / still, "x", 1.2, at_least=True)
    yield from cost("slam_sd.objects.long", long)
    paper = scores("sd-corridor-long", "paper/slam-sd")
    yield BenchmarkRow("slam_sd.objects.paper.right", mean_right(paper), "of 24", 22, at_least=True)
    yield from cost("slam_sd.objects.paper", paper)


def scores(
    world: str, config: str, overrides: Sequence[str] = (), name: str = "", tags: bool = True
) -> list[ObjectScore]:
    """One run for each seed, reported on stderr with its confusion table."""
    title = f"{name or world}, {config}{'' if tags else ', without tags'}"
    found = []
    for seed in SEEDS:
        found.append(mapped(simulated(world, seed, overrides, name), config, seed, FINE, tags))
        if tags:
            wrong = [
                explain(tagged_object) for tagged_object in found[-1].judged if not tagged_object.is_right
            ]
            say(f"{title}, seed {seed}: {found[-1].right} right{'; ' if wrong else ''}{', '.join(wrong)}")
    if tags:
        describe(title, found)
    return found


def explain(tagged_object: JudgedObject) -> str:
    """Why an object counts as wrong."""
    state = "right" if tagged_object.state_right else "wrong"
    return f"{tagged_object.id} off by {tagged_object.position_m:.2f} m, {tagged_object.heading_deg:.0f} deg, state {state}"


def describe(title: str, found: Sequence[ObjectScore]) -> None:
    """The confusion table: objects by class, and the class of what stands where they were reported."""
    pairs = Counter(
        (tagged_object.category, tagged_object.taken_for) for o in found for tagged_object in o.judged
    )
    classes = sorted({category for category, _ in pairs})
    places = sorted({place for _, place in pairs} - set(classes))
    say(f"{title}: reported (rows) at the place of (columns)")
    say(" " * 12 + "".join(f"{name:>12}" for name in (*classes, *places)))
    for category in classes:
        say(f"{category:12}" + "".join(f"{pairs[category, name]:12d}" for name in (*classes, *places)))
    tagged_objects = [tagged_object for o in found for tagged_object in o.judged]
    say(f"{title}: mean error {np.nanmean([t.position_m for t in tagged_objects]):.4f} m")


def moved_flags(found: Sequence[ObjectScore]) -> Iterator[BenchmarkRow]:
    """Precision and recall of the flag `moved`."""
    tagged_objects = [tagged_object for o in found for tagged_object in o.judged]
    both = sum(tagged_object.moved and bool(tagged_object.said_moved) for tagged_object in tagged_objects)
    precision = both / max(sum(bool(tagged_object.said_moved) for tagged_object in tagged_objects), 1)
    recall = both / max(sum(tagged_object.moved for tagged_object in tagged_objects), 1)
    yield BenchmarkRow("slam_sd.objects.moved.precision", precision, "", 0.95, at_least=True)
    yield BenchmarkRow("slam_sd.objects.moved.recall", recall, "", 0.95, at_least=True)


def cost(name: str, found: Sequence[ObjectScore]) -> Iterator[BenchmarkRow]:
    """CPU time of the whole run per scan; the stages' shares on stderr, scaled from wall clock."""
    cpu = float(np.median([o.cpu_ms for o in found]))
    stages = {
        stage: float(np.median([o.cpu_ms * o.stages_ms[stage] / sum(o.stages_ms.values()) for o in found]))
        for stage in found[0].stages_ms
    }
    say(f"{name}: CPU ms per scan: {', '.join(f'{k} {v:.2f}' for k, v in stages.items())}")
    yield BenchmarkRow(f"{name}.cpu_per_scan", cpu, "ms", 15.0)


def mean_right(found: Sequence[ObjectScore]) -> float:
    """Right objects, mean over the seeds."""
    return float(np.mean([o.right for o in found]))


def mean_ape(found: Sequence[ObjectScore]) -> float:
    """The rmse of the trajectory, mean over the seeds."""
    return float(np.mean([o.ape_m for o in found]))
