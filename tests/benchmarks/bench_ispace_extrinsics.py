"""Fixed cameras whose extrinsics are wrong by 5 cm and 2 degrees, or that are moved in mid-log, in the corridors by seed.

Each corridor is localized with the extrinsics as they are given, and with the correction by the robot's own passes. The errors of
the poses count from the first one that is called localized. `python -m tests.benchmarks.bench_ispace_extrinsics FIRST LAST`
prints a line for every corridor.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.evaluation.association import associate
from gridslam.methods.ispace_mcl.cameras.fixed_cameras import FixedCameras
from gridslam.methods.ispace_mcl.cameras.robot_passes import about
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.method import IspaceMcl
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.ispace_corridors import world_of
from tests.benchmarks.seen_corridor import SeenDrive, drive_through

Floats = NDArray[np.float64]

SEEDS = range(400, 404)
ERROR_M, ERROR_RAD = 0.05, float(np.radians(2.0))
BUMP_M, BUMP_RAD = 0.3, float(np.radians(4.0))


class _LeftAlone(FixedCameras):
    """Cameras that take their extrinsics as they are given."""

    def learn_extrinsics(self, pose: Floats) -> None:
        pass


@dataclass(frozen=True, slots=True)
class ExtrinsicsTrial:
    """Root mean square and largest error of the localized poses (m); the cameras with a correction, and how far these leave the
    floor at 5 m before the camera from where it is (m), without and with the correction, on the mean; cameras said to be moved.
    """

    rms_m: float
    worst_m: float
    corrected: int
    before_m: float
    after_m: float
    moved: int


def rows() -> Iterator[BenchmarkRow]:
    """Errors without and with the correction, of wrong extrinsics and of none; bumped cameras that are noticed."""
    for kind in ("wrong", "right", "bumped"):
        pairs = [(trial(seed, kind, False), trial(seed, kind, True)) for seed in SEEDS]
        label = f"ispace.extrinsics.{kind}"
        for name, k in (("given", 0), ("corrected", 1)):
            yield BenchmarkRow(f"{label}.{name}.rms", max(pair[k].rms_m for pair in pairs), "m")
        learned = [pair[1] for pair in pairs]
        yield BenchmarkRow(f"{label}.floor.before", float(np.nanmean([t.before_m for t in learned])), "m")
        yield BenchmarkRow(f"{label}.floor.after", float(np.nanmean([t.after_m for t in learned])), "m")
        yield BenchmarkRow(f"{label}.moved", sum(t.moved for t in learned), "cameras")


def trial(seed: int, kind: str, learns: bool) -> ExtrinsicsTrial:
    """Localize along the drive of a seed from its start, with every camera wrong, or moved when half of its frames have come."""
    drive = drive_through(world_of(seed))
    rng = np.random.default_rng([seed, 31])
    for camera in drive.cameras.values():
        signs, angle = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])
        if kind == "wrong":
            camera.error = about(camera.place, np.r_[ERROR_M * direction, signs * ERROR_RAD])
        elif kind == "bumped":
            camera.bump = about(camera.place, np.r_[BUMP_M * direction, signs * BUMP_RAD])
            camera.bumped_at = len(camera.frames) // 2
    start = drive.truth.poses[0].tolist()
    method = IspaceMcl(
        IspaceMclConfig(start=(start[0], start[1], start[2]), start_std=(0.1, 0.1, 0.05)), 0, drive.grid
    )
    if not learns:
        method.cameras.__class__ = _LeftAlone
    method.cameras.fixed.update(drive.cameras)
    for event in drive.events:
        method.process(event)
    return _judged(method, drive, kind)


def _judged(method: IspaceMcl, drive: SeenDrive, kind: str) -> ExtrinsicsTrial:
    result = method.result()
    pairs = associate(result.trajectory, drive.truth, sync="interpolate")
    off_m = np.hypot(*(pairs.estimate - pairs.truth)[:, :2].T)
    before, after = [], []
    moved = 0
    for name, measures in method.cameras.measures().items():
        assert isinstance(measures, dict)
        correction, camera = measures["correction"], drive.cameras[name]
        if correction is None:
            continue
        moved += correction["moves"]
        error = camera.bump if kind == "bumped" else camera.error
        ahead = camera.true_coverage.centres.mean(axis=0)
        wrong = camera.floor_error(ahead, error)
        before.append(wrong[0])
        after.append(wrong[1])
    return ExtrinsicsTrial(
        float(np.sqrt((off_m**2).mean())),
        float(off_m.max()),
        len(after),
        float(np.mean(before or [np.nan])),
        float(np.mean(after or [np.nan])),
        moved,
    )


def main(first: int, last: int) -> None:
    """Print the trials of some seeds."""
    for seed in range(first, last + 1):
        for kind in ("wrong", "right", "bumped"):
            for learns in (False, True):
                say(f"{seed} {kind} {'corrected' if learns else 'as given'} {trial(seed, kind, learns)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
