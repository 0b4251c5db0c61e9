"""The sample logs: `python -m gridslam.simulation.samples FOLDER [NAME ...]` writes them, always the same bytes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import load_world


@dataclass(frozen=True, slots=True)
class Sample:
    """Name of a sample log, the built-in world that it is recorded in, and overrides of that world."""

    name: str
    world: str
    overrides: tuple[str, ...] = ()


# Images make logs large: the samples have few and small ones.
_SMALL = (
    "width_px: 112, height_px: 84, focal_px: 84, rate_hz: 1, noise_levels: 0.2, depth_max_m: 9, "
    "depth_noise_per_m2: 0.001, depth_resolution_m: 0.02"
)
_FIXED = ", ".join(
    f"{{name: ispace{k}, kind: rgbd, extrinsics: {{x: {x}, y: 1.3, z: 2.4, pitch_deg: 28}}, {_SMALL}}}"
    for k, x in enumerate((1.0, 10.5, 20.0), start=1)
)
_STEREO = (
    "[{name: stereo, kind: stereo, rate_hz: 1, extrinsics: {x: 0.1, y: 0.06, z: 0.6}, "
    "width_px: 240, height_px: 180, focal_px: 195, baseline_m: 0.12, noise_levels: 0.4}]"
)
SAMPLES = (
    Sample("slam-sd.mcap", "office"),
    Sample("slam-sd-tags.mcap", "sd-corridor-short"),
    Sample("ir-scan.mcap", "ir-room"),
    Sample("ir-scan-csv", "ir-room"),
    Sample("handmap-slam.mcap", "hand-corridor-30", ("sensors.lidar.beams=180", "sensors.lidar.rate_hz=4")),
    Sample("ispace-mcl.mcap", "ispace-corridor", ("sensors.cameras=[]", f"fixed_cameras=[{_FIXED}]")),
    Sample("stereo-bayes.mcap", "stereo-room", (f"sensors.cameras={_STEREO}",)),
)


def write_samples(folder: Path, names: Sequence[str] = ()) -> None:
    """Write the samples with the given names, or all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    for sample in SAMPLES:
        if not names or sample.name in names:
            world, path = load_world(sample.world, sample.overrides)
            record_world(world, path.parent, folder / sample.name, force=True)


if __name__ == "__main__":
    write_samples(Path(sys.argv[1]), sys.argv[2:])
