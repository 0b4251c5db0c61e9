"""handmap-slam's warp over drawings of buildings as people make them: ten buildings, ten drawings of each, and wrong drawings.

The within_1m is the fraction of a drive's poses whose estimate in the drawing, mapped back by the true correspondence, lies
within 1 m of where the robot was. The map and the trajectory are the truth with 2 cm of noise (`mapped_buildings`).
`python -m tests.benchmarks.bench_drawn_buildings [FIRST [COUNT]]` prints each drawing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.drawing import drawn_map
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.localizer import first_states
from gridslam.methods.handmap_slam.warp.warp import DrawingWarp, warp_of
from tests.benchmarks.harness import Row, say
from tests.benchmarks.mapped_buildings import MappedBuilding, mapped_building
from tests.benchmarks.people_drawings import PeopleDrawing, drawing_of

PLACES = 10
DRAWINGS = 100
WRONG = 50
LOST_FRACTION = 0.5


@dataclass(frozen=True)
class Trial:
    """A drawing laid over a map: the within_1m of poses, whether it was said to fit, the cost of a place, and CPU time (s)."""

    within_1m: float
    fits: bool
    cost: float
    cpu_s: float


def trial(seed: int, is_wrong: bool = False) -> Trial:
    """A drawing of a building over its own map, or over that of the next building."""
    place = seed % PLACES
    own = mapped_building(place)
    drawing = drawing_of(own.building, seed)
    mapped = mapped_building((place + 1) % PLACES) if is_wrong else own
    begun = time.process_time()
    warp = laid_over(drawing, own.poses[0], mapped, seed)
    elapsed = time.process_time() - begun
    within_1m = 0.0
    if not is_wrong:
        points = own.poses[:, :2]
        within_1m = float((drawing.errors_m(points, warp.to_drawing(points, warp.graph.owners)) < 1.0).mean())
    return Trial(within_1m, warp.fits, warp.cost_per_place, elapsed)


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


def rows() -> Iterator[Row]:
    """All figures."""
    right = [trial(seed) for seed in range(DRAWINGS)]
    fractions = [t.within_1m for t in right]
    say(f"within_1m of poses by drawing: {np.round(fractions, 2).tolist()}")
    yield Row(
        "drawn_buildings.within_1m",
        float(np.mean(fractions)),
        "fraction of poses within 1 m",
        0.95,
        at_least=True,
    )
    yield Row("drawn_buildings.within_1m.worst", min(fractions), "fraction of poses within 1 m")
    unsaid = sum(t.fits and t.within_1m < LOST_FRACTION for t in right)
    yield Row("drawn_buildings.lost_unsaid", unsaid, "drawings")
    yield Row("drawn_buildings.right.said_to_fit", float(np.mean([t.fits for t in right])), "fraction")
    wrong = [trial(seed, is_wrong=True) for seed in range(WRONG)]
    yield Row("drawn_buildings.wrong.said_to_fit", float(np.mean([t.fits for t in wrong])), "fraction")
    yield Row("drawn_buildings.cpu", max(t.cpu_s for t in right), "s")


def main() -> None:
    """Print trials."""
    first, count = (int(v) for v in (sys.argv[1:] + ["0", "100"][len(sys.argv) - 1 :])[:2])
    for seed in range(first, first + count):
        right, wrong = trial(seed), trial(seed, is_wrong=True)
        say(
            f"{seed}: within_1m {right.within_1m:.3f} fits {right.fits} cost {right.cost:.2f} cpu {right.cpu_s:.1f}; "
            f"wrong: fits {wrong.fits} cost {wrong.cost:.2f} cpu {wrong.cpu_s:.1f}"
        )


if __name__ == "__main__":
    main()
