"""handmap-slam's pose in the drawing while the robot drives, in drawings of buildings whose wings differ in scale.

`python -m tests.benchmarks.bench_driving_in_drawings [FIRST [COUNT]]` prints each drawing. The robot's own track is the truth,
and its scans have 2 cm of noise; a pose is compared when the robot is there, with nothing seen of what comes later.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import numpy as np

from gridslam.core import poses as se2
from gridslam.maps.drawings.drawing import drawn_map
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_tracker import localizer_of
from tests.benchmarks.bench_drawn_buildings import PLACES
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.mapped_buildings import mapped_building
from tests.benchmarks.people_drawings import drawing_of

DRAWINGS = 10  # in `make bench`; more by argument
NEAR_M, LOST_M = 1.0, 3.0


def trial(seed: int) -> tuple[float, float, float]:
    """The fractions of poses within 1 m of where the robot is and farther than 3 m from it, and CPU time (s)."""
    mapped = mapped_building(seed % PLACES)
    drawing = drawing_of(mapped.building, seed)
    config = HandmapSlamConfig(start=drawing.pose_in_drawing(mapped.poses[0]))
    assert config.start is not None
    drawn = drawn_map(drawing.drawing, start_xy=config.start[:2])
    begun = time.process_time()
    localizer = localizer_of(config, drawn, np.random.default_rng(seed))
    estimates = [localizer.start(mapped.points(0)).state[:2]]
    for row in range(1, len(mapped.poses)):
        localizer.predict(se2.between(mapped.poses[row - 1], mapped.poses[row]))
        estimates.append(localizer.update(mapped.points(row)).state[:2])
    elapsed = time.process_time() - begun
    errors = drawing.errors_m(mapped.poses[:, :2], np.array(estimates))
    return float((errors < NEAR_M).mean()), float((errors > LOST_M).mean()), elapsed


def rows() -> Iterator[BenchmarkRow]:
    """All figures."""
    yield from figures(0, DRAWINGS)


def figures(first: int, count: int) -> Iterator[BenchmarkRow]:
    """Figures of drawings by seed, each said when it is done."""
    found = []
    for seed in range(first, first + count):
        found.append(trial(seed))
        say("{}: within 1 m {:.3f}, farther than 3 m {:.3f}, cpu {:.1f}".format(seed, *found[-1]))
    near, lost, _ = np.array(found).T
    yield BenchmarkRow("driving_in_drawings.within_1m", float(near.mean()), "fraction of poses")
    yield BenchmarkRow("driving_in_drawings.within_1m.worst", float(near.min()), "fraction of poses")
    yield BenchmarkRow("driving_in_drawings.lost", float(lost.mean()), "fraction of poses")


def main() -> None:
    """Print trials and figures."""
    first, count = (int(v) for v in [*sys.argv[1:3], *("0", "30")[len(sys.argv) - 1 :]])
    for row in figures(first, count):
        say(f"{row.name}: {row.value:.4g} {row.unit}")


if __name__ == "__main__":
    main()
