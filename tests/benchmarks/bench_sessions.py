"""Several drives as one map: a recorded log cut into drives, places that change between drives, and the cost of continuing.

Four changing places of each kind; GRIDSLAM_SESSIONS_SEEDS=20 in the environment runs 20. Parts by
`python -m tests.benchmarks.bench_sessions aces` (or wean_hall, tagged, known, cost), or `... office FIRST END` for some seeds.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gridslam.api import map_log
from gridslam.core.messages import Event, LaserScan
from gridslam.evaluation.readers.files import read_relations, read_trajectory
from gridslam.evaluation.relations import relation_errors
from gridslam.lidar_slam.sessions.session import Session
from gridslam.lidar_slam.sessions.session_file import read_session
from gridslam.methods.base import RunResult
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import SlamSd
from gridslam.simulation.places.build import place_document
from gridslam.simulation.places.config import Kind
from gridslam.simulation.record import truth_folder
from tests.benchmarks.change_scores import path_error_m, scores, static_walls
from tests.benchmarks.changed_worlds import drives_of, recorded
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir, events_of
from tests.benchmarks.tagged_worlds import aligned, judged, simulated

SEEDS = range(int(os.environ.get("GRIDSLAM_SESSIONS_SEEDS", "4")))
KINDS: tuple[Kind, ...] = ("office", "corridors")
TAGGED = ("sd-corridor-long", "sd-corridor-long-moved", "sd-corridor-long")
COST_TRAVEL_M, COST_RUNS = 80.0, 3
KNOWN_SEEDS, KNOWN_TRAVEL_M = (0, 1), 50.0
COMPARED = 1, 7  # the second and the eighth drive: the first continues nothing
OVERLAP = 0.06  # of the log, on each side of a cut


def rows() -> Iterator[BenchmarkRow]:
    """Relations of cut logs, precision and recall of changed cells, and CPU time of the last of 1, 2, 4 and 8 drives."""
    for part in PARTS.values():
        yield from part()


def _cut_log() -> Iterator[BenchmarkRow]:
    folder = data_dir()
    if folder is None:
        return
    events = events_of(folder / "lidar" / "aces.clf.bz2")
    relations = read_relations(folder / "lidar" / "aces.relations")
    means: dict[str, float] = {}
    for name, count, order in (
        ("one", 1, [0]),
        ("two", 2, [0, 1]),
        ("reverse", 2, [1, 0]),
        ("five", 5, [0, 1, 2, 3, 4]),
    ):
        result = _mapped([_part(events, k, count) for k in order])
        means[name] = float(relation_errors(result.trajectory, relations).errors.translation_m.mean())
        say(f"aces in {name}: relations.trans.mean {means[name]:.4f} m")
        if count > 1:
            yield BenchmarkRow(f"sessions.aces.{name}.ratio", means[name] / means["one"], "of one drive")


def _changed_hall() -> Iterator[BenchmarkRow]:
    """Two recorded drives through one corridor, with doors open and shut in between, in both orders."""
    folder = data_dir()
    if folder is None:
        return
    drives = [events_of(folder / "wean_hall" / f"robotdata{k}.log.gz") for k in (1, 2)]
    results = [_mapped(order) for order in (drives, drives[::-1])]
    joined = sum(bool(result.measures["session"]["is_joined"]) for result in results)  # type: ignore[index]
    yield BenchmarkRow("sessions.wean_hall.joined", joined, "of both orders")


def _part(events: Sequence[Event], k: int, count: int) -> list[Event]:
    """The k-th of `count` parts of a log, which overlap."""
    stamps = np.array([event.stamp_ns for event in events if isinstance(event, LaserScan)], np.int64)
    low, high = (float(np.clip(v, 0.0, 1.0)) for v in (k / count - OVERLAP, (k + 1) / count + OVERLAP))
    first, last = stamps[int(low * (len(stamps) - 1))], stamps[int(high * (len(stamps) - 1))]
    return [event for event in events if first <= event.stamp_ns <= last or event.stamp_ns < stamps[0]]


def _mapped(drives: Sequence[Sequence[Event]]) -> RunResult:
    """The result of the last drive, each continuing the one before it."""
    session, result = None, None
    for k, events in enumerate(drives):
        method = SlamSd(SlamSdConfig(), 0, session=session, log_name=f"drive {k + 1}")
        for event in events:
            method.process(event)
        result = method.result()
        session = read_session(result.files["session.npz"], "session.npz")
    assert result is not None
    return result


def _changed_places() -> Iterator[BenchmarkRow]:
    for kind in KINDS:
        each = [_changed_place(kind, seed) for seed in SEEDS]
        right, reported, found, true, lost, static = np.sum([place.counts for place in each], axis=0).tolist()
        recalls = [place.counts[2] / max(place.counts[3], 1) for place in each]
        yield BenchmarkRow(f"sessions.{kind}.precision", right / max(reported, 1), "of reported cells")
        yield BenchmarkRow(f"sessions.{kind}.recall", found / max(true, 1), "of changed cells")
        yield BenchmarkRow(f"sessions.{kind}.recall.worst", min(recalls), "of changed cells")
        yield BenchmarkRow(f"sessions.{kind}.static_lost", lost / max(static, 1), "of cells of static walls")
        yield BenchmarkRow(f"sessions.{kind}.lost_piece", max(place.lost_piece_m for place in each), "m")
        yield BenchmarkRow(
            f"sessions.{kind}.unjoined", sum(place.unjoined for place in each), f"of {len(SEEDS)}"
        )
        yield BenchmarkRow(
            f"sessions.{kind}.ape_ratio",
            float(np.median([p.ape_ratio for p in each])),
            "of each drive alone",
        )


class Changed(NamedTuple):
    """Cells reported rightly, reported, found, and changed, of static walls lost, and all; the longest lost piece of a wall;
    drives that were not joined; error of the path by that of each drive alone."""

    counts: Sequence[int]
    lost_piece_m: float
    unjoined: int
    ape_ratio: float


def _changed_place(kind: Kind, seed: int) -> Changed:
    drives = drives_of(kind, seed)
    counts, lost_piece_m = np.zeros(6, np.int64), 0.0
    for k in range(1, len(drives.results)):
        *static, piece_m = static_walls(drives, k)
        counts += [*scores(drives, k), *static]
        lost_piece_m = max(lost_piece_m, piece_m)
    last = drives.results[-1]
    joint = [path_error_m(last.trajectories[f"trajectory_{k + 1}"], t) for k, t in enumerate(drives.truths)]
    alone = [path_error_m(r.trajectory, t) for r, t in zip(drives.alone, drives.truths, strict=True)]
    unjoined = sum(not r.measures["session"]["is_joined"] for r in drives.results[1:])  # type: ignore[index]
    right, reported, found, true, lost, standing = counts.tolist()
    say(
        f"{kind} {seed}: right {right} of {reported} reported, found {found} of {true} changed, static walls lost {lost} of "
        f"{standing}, at most {lost_piece_m:.2f} m of one, not joined {unjoined}, APE {np.mean(joint):.3f} m, "
        f"alone {np.mean(alone):.3f} m"
    )
    return Changed(counts.tolist(), lost_piece_m, unjoined, float(np.mean(joint) / np.mean(alone)))


def _tagged_corridor() -> Iterator[BenchmarkRow]:
    """The paper's corridor in three sessions, eight of its 24 objects moved during the second."""
    right = []
    with tempfile.TemporaryDirectory() as folder:
        before: Path | None = None
        for k, world in enumerate(TAGGED):
            log = simulated(world, k)
            truth = truth_folder(log)
            found = map_log(log, "slam-sd", tags=truth / "tags.yaml", session=before)
            before = found.save(Path(folder) / str(k))
            result = found.run.result
            path = result.trajectories.get(f"trajectory_{k + 1}", result.trajectory)
            T_truth_map, _ = aligned(path, read_trajectory(truth / "trajectory.tum"))
            right.append(sum(each.is_right for each in judged(result, truth / "objects.csv", T_truth_map)))
    say(f"tagged corridor, objects right in each session: {right}")
    yield BenchmarkRow("sessions.tagged.right", min(right), "of 24")


def _known_change() -> Iterator[BenchmarkRow]:
    """Localization in a changed place, on the map from before the change, and on that of the session that has seen it."""
    for seed in KNOWN_SEEDS:
        drives = drives_of("office", seed, number=2, travel_m=KNOWN_TRAVEL_M)
        events = list(recorded({**drives.worlds[1], "seed": 7000 + seed}, []))
        for name, result in zip(("unknown", "known"), drives.results, strict=True):
            assert result.occupancy is not None
            method = IspaceMcl(IspaceMclConfig(), seed, result.occupancy)
            for event in events:
                method.process(event)
            found = method.result()
            localized = found.measures["localization"]["localized_fraction"]  # type: ignore[index]
            confidence = float(np.mean(found.series["confidence"].values))
            say(f"office {seed}, change {name}: localized {localized:.2f}, mean confidence {confidence:.2f}")
            yield BenchmarkRow(f"sessions.{name}_change.localized.{seed}", localized, "of scans")
            yield BenchmarkRow(f"sessions.{name}_change.confidence.{seed}", confidence, "")


def _cost() -> Iterator[BenchmarkRow]:
    """CPU time and memory of what a drive costs beyond its own tracking, when it is the first to the eighth.

    All drives follow the same route through the same place, so the new drive meets all earlier ones everywhere. The second and
    the eighth are run three times, and the shortest time counts: other programs can only lengthen it.
    """
    document = place_document("office", 0, COST_TRAVEL_M)
    session = None
    seconds: list[float] = []
    memory: dict[int, float] = {}
    for k in range(8):
        events = list(recorded({**document, "seed": k}, []))
        tracked = [_tracked(events, session, k) for _ in range(COST_RUNS if k in COMPARED else 1)]
        started = [time.process_time()]
        for method in tracked:
            result = method.result()
            started.append(time.process_time())
        seconds.append(float(np.diff(started).min()))
        if k in COMPARED:
            again = _tracked(events, session, k)
            tracemalloc.start()
            again.result()
            memory[k] = tracemalloc.get_traced_memory()[1] / 1e6
            tracemalloc.stop()
        session = read_session(result.files["session.npz"], "session.npz")
    second, eighth = COMPARED
    say(f"drives of {COST_TRAVEL_M:.0f} m: CPU seconds after the last scan {np.round(seconds, 1).tolist()}")
    say(
        f"memory (MB) after the last scan of the second and the eighth {np.round(list(memory.values()), 1).tolist()}"
    )
    yield BenchmarkRow("sessions.cost.eighth", seconds[eighth] / seconds[second], "of the second")
    yield BenchmarkRow("sessions.cost.memory.eighth", memory[eighth] / memory[second], "of the second")


def _tracked(events: Sequence[Event], session: Session | None, k: int) -> SlamSd:
    """The method after the last scan of drive `k`."""
    method = SlamSd(SlamSdConfig(), 0, session=session, log_name=f"drive {k + 1}")
    for event in events:
        method.process(event)
    return method


PARTS = {
    "aces": _cut_log,
    "wean_hall": _changed_hall,
    "changed": _changed_places,
    "tagged": _tagged_corridor,
    "known": _known_change,
    "cost": _cost,
}


def main() -> None:
    """Print the rows of the named parts; after a kind of place, the changes found with seeds FIRST to END - 1."""
    name, *seeds = sys.argv[1:]
    if name in PARTS:
        for row in PARTS[name]():
            say(f"{row.name} {row.value:.4f} {row.unit}")
        return
    for seed in range(*map(int, seeds)):
        _changed_place("office" if name == "office" else "corridors", seed)


if __name__ == "__main__":
    main()
