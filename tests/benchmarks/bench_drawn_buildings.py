"""handmap-slam's warp over drawings of buildings as people make them: ten buildings, ten drawings of each, and wrong drawings.

The within_1m is the fraction of a drive's poses whose estimate in the drawing, mapped back by the true correspondence, lies
within 1 m of where the robot was. The map and the trajectory are the truth with 2 cm of noise (`mapped_buildings`).
`python -m tests.benchmarks.bench_drawn_buildings [FIRST [COUNT [WRONG]]]` prints each of COUNT drawings,
and of WRONG ones over the map of another building.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.drawings.drawing import drawn_map
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.localizer import first_states
from gridslam.methods.handmap_slam.warp.warp import DrawingWarp, warp_of
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.mapped_buildings import MappedBuilding, mapped_building
from tests.benchmarks.people_drawings import PeopleDrawing, drawing_of

PLACES = 10
DRAWINGS = 20  # in `make bench`; more by argument
WRONG = 5
WRONG_M = 2.0  # a pose is wrong if it is this far away
LOST_FRACTION = 0.5


@dataclass(frozen=True)
class DrawnTrial:
    """A drawing laid over a map: the fractions of its poses within 1 m, of those said to be doubtful, and of those wrong and not
    said to be; whether it is said to fit; the cost of a place, and CPU time (s)."""

    within_1m: float
    doubtful: float
    wrong_unsaid: float
    fits: bool
    cost: float
    cpu_s: float


def trial(seed: int, is_wrong: bool = False) -> DrawnTrial:
    """A drawing of a building over its own map, or over that of the next building."""
    place = seed % PLACES
    own = mapped_building(place)
    drawing = drawing_of(own.building, seed)
    mapped = mapped_building((place + 1) % PLACES) if is_wrong else own
    begun = time.process_time()
    warp = laid_over(drawing, own.poses[0], mapped, seed)
    elapsed = time.process_time() - begun
    errors = np.full(len(mapped.poses), np.inf)
    if not is_wrong:
        points = own.poses[:, :2]
        errors = drawing.errors_m(points, warp.to_drawing(points, warp.graph.owners))
    doubtful = warp.doubtful_poses
    return DrawnTrial(
        within_1m=float((errors < 1.0).mean()),
        doubtful=float(doubtful.mean()),
        wrong_unsaid=float(((errors > WRONG_M) & ~doubtful).mean()),
        fits=warp.fits,
        cost=warp.cost_per_place,
        cpu_s=elapsed,
    )


def laid_over(
    drawing: PeopleDrawing, start: NDArray[np.float64], mapped: MappedBuilding, seed: int
) -> DrawingWarp:
    """The warp, with the start in the drawing known as well as a user knows it."""
    config = HandmapSlamConfig(start=drawing.pose_in_drawing(start))
    assert config.start is not None
    drawn = drawn_map(drawing.drawing, start_xy=config.start[:2])
    rng = np.random.default_rng(seed)
    first = partial(first_states, config, drawn, rng=rng)
    return warp_of(drawn, mapped.occupancy, mapped.poses, first, rng)


def rows() -> Iterator[BenchmarkRow]:
    """All figures."""
    yield from figures(0, DRAWINGS, WRONG)


def figures(first: int, count: int, wrong_count: int) -> Iterator[BenchmarkRow]:
    """Figures of drawings by seed, each said when it is done."""
    right = [_said(seed) for seed in range(first, first + count)]
    fractions = [t.within_1m for t in right]
    yield BenchmarkRow("drawn_buildings.within_1m", float(np.mean(fractions)), "fraction of poses within 1 m")
    yield BenchmarkRow("drawn_buildings.within_1m.worst", min(fractions), "fraction of poses within 1 m")
    yield BenchmarkRow(
        "drawn_buildings.wrong_unsaid", float(np.mean([t.wrong_unsaid for t in right])), "fraction of poses"
    )
    yield BenchmarkRow(
        "drawn_buildings.wrong_unsaid.worst", max(t.wrong_unsaid for t in right), "fraction of poses"
    )
    yield BenchmarkRow(
        "drawn_buildings.doubtful", float(np.mean([t.doubtful for t in right])), "fraction of poses"
    )
    unsaid = sum(t.fits and t.within_1m < LOST_FRACTION for t in right)
    yield BenchmarkRow("drawn_buildings.lost_unsaid", unsaid, "drawings")
    yield BenchmarkRow(
        "drawn_buildings.right.said_to_match", float(np.mean([t.fits for t in right])), "fraction"
    )
    yield BenchmarkRow("drawn_buildings.cpu", max(t.cpu_s for t in right), "s")
    if wrong_count:
        wrong = [_said(seed, is_wrong=True) for seed in range(first, first + wrong_count)]
        fitting = float(np.mean([t.fits for t in wrong]))
        yield BenchmarkRow("drawn_buildings.wrong.said_to_match", fitting, "fraction")


def _said(seed: int, is_wrong: bool = False) -> DrawnTrial:
    result = trial(seed, is_wrong)
    say(
        f"{seed}{' over another building' if is_wrong else ''}: within_1m {result.within_1m:.3f} doubtful {result.doubtful:.2f} "
        f"wrong and unsaid {result.wrong_unsaid:.3f} fits {result.fits} cost {result.cost:.2f} cpu {result.cpu_s:.1f}"
    )
    return result


def main() -> None:
    """Print trials and figures."""
    first, count, wrong_count = (int(v) for v in [*sys.argv[1:4], *("0", "100", "100")[len(sys.argv) - 1 :]])
    for row in figures(first, count, wrong_count):
        say(f"{row.name}: {row.value:.4g} {row.unit}")


if __name__ == "__main__":
    main()
